// SPDX-License-Identifier: Apache-2.0
// Elements without markup in strings: foreign data are always text.

// An element with properties (`class`, `on…` handlers, `aria-…` and other attributes) and children
// (elements, text, null).
export function h(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (value === undefined || value === null || value === false) continue;
    if (name.startsWith('on')) {
      element.addEventListener(name.slice(2).toLowerCase(), value);
    } else if (name === 'value' || name === 'checked') {
      element[name] = value;
    } else {
      element.setAttribute(name, value === true ? '' : value);
    }
  }
  element.append(...children.flat().filter((child) => child !== null && child !== undefined && child !== false));
  return element;
}

// Asks in a modal dialogue; resolves to whether `action` was chosen.
export function confirmDialog({title, text, action, keep}) {
  return new Promise((resolve) => {
    const dialog = h('dialog', {'aria-labelledby': 'dialog-title'},
        h('h2', {id: 'dialog-title'}, title),
        h('p', {}, text),
        h('form', {method: 'dialog', class: 'buttons'},
            h('button', {value: 'no', autofocus: true}, keep),
            h('button', {value: 'yes', class: 'danger'}, action)));
    dialog.addEventListener('close', () => {
      dialog.remove();
      resolve(dialog.returnValue === 'yes');
    });
    document.body.append(dialog);
    dialog.showModal();
  });
}

export function timeText(timestamp) {
  const time = new Date(timestamp ?? '');
  if (Number.isNaN(time.getTime())) return '';
  const today = new Date().toDateString() === time.toDateString();
  return time.toLocaleString([], today ? {timeStyle: 'medium'} : {dateStyle: 'medium', timeStyle: 'short'});
}

export const STATES = {
  QUEUED: ['queued', '○'], RUNNING: ['running', '◐'], SUCCEEDED: ['done', '●'], FAILED: ['failed', '✕'],
  CANCELLED: ['cancelled', '–'],
};

// Word and sign, so that the colour is not needed.
export function stateBadge(state) {
  const [word, sign] = STATES[state] ?? [String(state ?? 'unknown').toLowerCase(), '?'];
  return h('span', {class: `state ${word}`}, h('span', {'aria-hidden': 'true'}, sign), ` ${word}`);
}

export function kindTitle(kind) { return kind ? kind[0].toUpperCase() + kind.slice(1) : 'Job'; }
