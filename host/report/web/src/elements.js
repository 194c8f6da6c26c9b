// SPDX-License-Identifier: Apache-2.0
function filled(made, attributes, children) {
  for (const [key, value] of Object.entries(attributes)) {
    if (key.startsWith('on')) made.addEventListener(key.slice(2), value);
    else if (value === true) made.setAttribute(key, '');
    else if (value !== false && value !== undefined) made.setAttribute(key, value);
  }
  made.append(...children);
  return made;
}

/** element('p', {class: 'note'}, 'text', child…); on… attributes are listeners. */
export const element = (name, attributes = {}, ...children) => filled(document.createElement(name), attributes, children);
export const svgElement = (name, attributes = {}, ...children) =>
  filled(document.createElementNS('http://www.w3.org/2000/svg', name), attributes, children);

let names = 0;
/** A group of choices of which one holds, as buttons beside each other. */
export function choice(label, options, chosen, changed) {
  const name = `choice${++names}`;
  return element('fieldset', {class: 'choice'}, element('legend', {}, label), ...options.map(([value, text]) =>
    element('label', {}, element('input', {
      type: 'radio', name, value, checked: value === chosen, onchange: () => changed(value),
    }), element('span', {}, text))));
}

export function select(label, options, chosen, changed) {
  return element('label', {class: 'field'}, element('span', {}, label), element('select', {
    onchange: (event) => changed(event.target.value),
  }, ...options.map(([value, text]) => element('option', {value, selected: value === chosen}, text))));
}

export function check(label, checked, changed) {
  return element('label', {class: 'check'}, element('input', {
    type: 'checkbox', checked, onchange: (event) => changed(event.target.checked),
  }), element('span', {}, label));
}
