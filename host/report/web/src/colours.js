// SPDX-License-Identifier: Apache-2.0
const names = ['paper', 'ink', 'soft', 'grid', 'axis', 'before', 'after', 'floor', 'x', 'y', 'z'];
const paper = matchMedia('print');
let printing = false;

/** Whether what is drawn now is for paper: before a page is printed the style sheet does not know it yet. */
export const onPaper = () => printing || paper.matches;

let light;
/** The page's colours have one home, its style sheet: light, dark and paper, which is light in a dark room too. */
export function colours() {
  if (!light) {
    light = document.createElement('div');
    light.className = 'light';
    light.hidden = true;
    document.body.append(light);
  }
  const style = getComputedStyle(onPaper() ? light : document.documentElement);
  return Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
}

/** Calls when the screen takes another scheme, when the page goes to paper and when it comes back. */
export function onColours(changed) {
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', changed);
  paper.addEventListener('change', changed);
  for (const [event, now] of [['beforeprint', true], ['afterprint', false]]) {
    window.addEventListener(event, () => {
      printing = now;
      changed();
    });
  }
}
