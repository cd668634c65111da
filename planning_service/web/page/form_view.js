// SPDX-License-Identifier: Apache-2.0
// The form of one task: inputs made from the table of fields.
import {FIELD_BY_PATH, SECTIONS} from './fields.js';
import {h} from './dom.js';
import {getPath} from './task_model.js';
import {domainText, humanNumber, isNumeric, parseDomain, parseNumber, UNIT_NAMES} from './units.js';

function idOf(path) { return `field-${path.replaceAll('.', '-')}`; }

// Text of a value of the task in its input; null: the form cannot show it.
function textOf(field, value) {
  if (value === undefined) return '';
  switch (field.type) {
    case 'number': return isNumeric(value) ? humanNumber(value, field.exponent) : null;
    case 'domain': return domainText(value, field.exponent);
    case 'list': return Array.isArray(value) ? value.join(', ') : null;
    default: return typeof value === 'string' ? value : null;
  }
}

// {value} of the text of an input (undefined: left out), or {error}.
function valueOf(field, text) {
  if (text.trim() === '') return {value: undefined};
  switch (field.type) {
    case 'number': return parseNumber(text, field);
    case 'domain': return parseDomain(text, field);
    case 'list': return {value: text.split(/[,;]/).map((item) => item.trim()).filter(Boolean)};
    default: return {value: text};
  }
}

export class FormView {
  // `onChange(path, value)` gets the user's input.
  constructor(onChange) {
    this.onChange = onChange;
    this.controls = new Map();
    this.element = h('div', {class: 'form'}, SECTIONS.map((section) => this.section(section)));
  }

  section(section) {
    const grid = (fields) => h('div', {class: 'fields'}, fields.map((field) => this.control(field)));
    const body = [
      section.intro ? h('p', {class: 'soft intro'}, section.intro) : null,
      grid(section.fields),
      section.more ? h('details', {class: 'more'},
          h('summary', {}, section.moreTitle ?? 'More'), grid(section.more)) : null,
      h('p', {class: 'derived', id: `derived-${section.id}`, hidden: true}),
    ];
    const element = section.closed ?
        h('details', {class: 'card'}, h('summary', {}, h('h2', {}, section.title)), body) :
        h('section', {class: 'card', 'aria-labelledby': `title-${section.id}`},
            h('h2', {id: `title-${section.id}`}, section.title), body);
    element.dataset.kinds = (section.kinds ?? []).join(' ');
    return element;
  }

  control(field) {
    const id = idOf(field.path);
    const error = h('p', {class: 'error', id: `${id}-error`, hidden: true});
    const help = field.help ? h('p', {class: 'help', id: `${id}-help`}, field.help) : null;
    const described = [help ? help.id : '', error.id].join(' ').trim();
    const common = {id, name: field.path, 'aria-describedby': described};
    let input, body;
    if (field.type === 'flag') {
      input = h('input', {...common, type: 'checkbox', onchange: () => this.take(field)});
      body = h('label', {class: 'flag'}, input, ' ', field.label);
    } else if (field.type === 'choice') {
      input = h('select', {...common, onchange: () => this.take(field)},
          h('option', {value: ''}, field.fallback),
          field.choices.filter((choice) => choice !== field.fallback)
              .map((choice) => h('option', {value: choice}, UNIT_NAMES[choice] ?? choice)));
      body = [h('label', {for: id}, field.label), input];
    } else {
      input = h('input', {
        ...common, type: 'text', placeholder: field.fallback, autocomplete: 'off', spellcheck: 'false',
        inputmode: field.type === 'number' ? (field.integer ? 'numeric' : 'decimal') : 'text',
        oninput: () => this.take(field),
      });
      body = [
        h('label', {for: id}, field.label, field.unit ? h('span', {class: 'visually-hidden'}, ` in ${field.unit}`) : null),
        h('span', {class: 'with-unit'}, input, field.unit ? h('span', {class: 'unit', 'aria-hidden': 'true'}, field.unit) : null),
      ];
    }
    const element = h('div', {class: `field type-${field.type}${field.wide ? ' wide' : ''}`}, body, help, error);
    element.dataset.kinds = (field.kinds ?? []).join(' ');
    this.controls.set(field.path, {field, element, input, error});
    return element;
  }

  take(field) {
    const {input} = this.controls.get(field.path);
    const {value, error} = field.type === 'flag' ? {value: input.checked || undefined} : valueOf(field, input.value);
    this.mark(field.path, error);
    if (!error) this.onChange(field.path, value);
  }

  // Fills the inputs from a task. An input whose text means the same keeps it, with its mark.
  fill(task) {
    for (const control of this.controls.values()) {
      const {field, input} = control;
      const value = getPath(task, field.path);
      if (field.type === 'flag') {
        input.checked = value === true;
        continue;
      }
      const text = textOf(field, value);
      const isUnshowable = text === null;
      const isSame = JSON.stringify(valueOf(field, input.value).value) === JSON.stringify(value);
      if (isSame && !control.isUnshowable && !isUnshowable) continue;
      control.isUnshowable = isUnshowable;
      this.mark(field.path, isUnshowable ? 'is in the JSON below, in a form that cannot be shown here' : '');
      if (field.type === 'choice') {
        this.choose(field, input, text ?? '');
      } else {
        input.value = text ?? '';
      }
    }
  }

  choose(field, select, text) {
    // The option that stands for the default has no value of its own.
    const value = text === field.fallback ? '' : text;
    if (![...select.options].some((option) => option.value === value)) select.append(h('option', {value}, value));
    select.value = value;
  }

  showKind(kind) {
    for (const element of this.element.querySelectorAll('[data-kinds]')) {
      const kinds = element.dataset.kinds;
      element.hidden = kinds !== '' && !kinds.split(' ').includes(kind);
    }
  }

  // Shows an error at a field, or takes it away.
  mark(path, description) {
    const control = this.controls.get(path);
    if (!control) return;
    const {input, error} = control;
    error.textContent = description || '';
    error.hidden = !description;
    if (description) {
      input.setAttribute('aria-invalid', 'true');
    } else {
      input.removeAttribute('aria-invalid');
    }
  }

  clearMarks() { for (const path of this.controls.keys()) this.mark(path, ''); }

  // Fields of the kind shown whose text means nothing: [{path, description}].
  unread() {
    const found = [];
    for (const [path, {field, element, input}] of this.controls) {
      if (field.type === 'flag' || element.closest('[hidden]')) continue;
      const {error} = valueOf(field, input.value);
      if (error) found.push({path, description: error});
    }
    return found;
  }

  label(path) { return FIELD_BY_PATH.get(path)?.label ?? path; }

  focus(path) {
    const control = this.controls.get(path);
    if (!control) return false;
    for (let box = control.element.closest('details'); box; box = box.parentElement.closest('details')) box.open = true;
    control.input.focus();
    control.element.scrollIntoView({block: 'center'});
    return true;
  }

  // Opens sections that hide marked fields.
  reveal(path) {
    const control = this.controls.get(path);
    for (let box = control?.element.closest('details'); box; box = box.parentElement.closest('details')) box.open = true;
  }

  isShown(path) {
    const control = this.controls.get(path);
    return Boolean(control) && !control.element.closest('[hidden]');
  }
}
