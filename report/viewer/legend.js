// SPDX-License-Identifier: Apache-2.0
// Lines of a legend of colours.

export function swatch(colour) {
  const element = document.createElement('span');
  element.className = 'swatch';
  element.style.background = colour;
  return element;
}

export const grouped = (n) => String(n).replace(/\B(?=(\d{3})+$)/g, '\u202f');

/** A colour, its meaning, how many targets have it, and a box that calls `show(shown)`. */
export function legendLine(colour, text, count, shown, show) {
  const label = document.createElement('label');
  const box = document.createElement('input');
  box.type = 'checkbox';
  box.checked = shown;
  box.addEventListener('change', () => show(box.checked));
  const number = document.createElement('span');
  number.className = 'count';
  number.textContent = grouped(count);
  const words = document.createElement('span');
  words.textContent = text;
  label.append(box, swatch(colour), words, number);
  return label;
}
