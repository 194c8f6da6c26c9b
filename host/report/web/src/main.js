// SPDX-License-Identifier: Apache-2.0
import './page.css';
import {ArmView} from './view.js';
import {readData} from './data.js';
import {element} from './elements.js';
import {Explorer} from './explorer.js';

const data = readData(document.getElementById('data').textContent);

const place = document.querySelector('.view3d');
const explorers = new Map();
let view = null;
if (place && data.arm) {
  try {
    view = new ArmView(place, data, (number, pose) => explorers.forEach((e, n) => e.choose(n === number ? pose : -1)));
  } catch (error) {
    place.replaceChildren(element('p', {class: 'note'}, 'This browser draws no 3-D here (no WebGL): the view of the arm ',
      'is missing, everything else is on the page.'));
    place.dataset.missing = error.message;
  }
}
for (const at of document.querySelectorAll('.explore')) {
  const number = Number(at.dataset.set);
  explorers.set(number, new Explorer(at, data.sets[number], view && ((pose) => view.choose(number, pose))));
}
view?.tell();
// From here on the drawings that these replace are for paper only.
document.documentElement.classList.add('live');
