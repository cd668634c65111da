// SPDX-License-Identifier: Apache-2.0
// Pictures, and a dialog that shows one enlarged.
import {element} from './elements';
import {Picture} from './report_data';

const sourceOf = (picture: Picture): string => `data:image/png;base64,${picture.png ?? ''}`;
const wordsOf = (picture: Picture): string => picture.alternative || picture.caption || '';

function enlarge(picture: Picture): void {
  const close = element('button', {type: 'submit', class: 'close'}, 'Close');
  const dialog = element('dialog', {'aria-label': wordsOf(picture) || 'Picture'},
      element('form', {method: 'dialog'}, close),
      element('img', {src: sourceOf(picture), alt: wordsOf(picture)}), element('p', {class: 'soft'}, wordsOf(picture)));
  dialog.addEventListener('click', (event) => {
    if (event.target === dialog) dialog.close();
  });
  dialog.addEventListener('close', () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}

export function pictureElement(picture: Picture): HTMLElement {
  const image = element('img', {src: sourceOf(picture), alt: wordsOf(picture), class: picture.pixels ? 'pixels' : undefined});
  return element('figure', {}, image, picture.caption ? element('figcaption', {}, picture.caption) : null);
}

/** A small picture that a press enlarges. */
export function thumbnail(picture: Picture): HTMLElement {
  const button = element('button', {'type': 'button', 'class': 'thumb', 'aria-label': `Enlarge: ${wordsOf(picture)}`},
      element('img', {src: sourceOf(picture), alt: '', loading: 'lazy'}));
  button.addEventListener('click', () => enlarge(picture));
  return button;
}
