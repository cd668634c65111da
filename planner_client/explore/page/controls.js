// SPDX-License-Identifier: Apache-2.0
// Sliders and number fields of the nine parameters and of the lens's settings.
import {allowedText, isAllowed, nearestAllowed, ratioPlace, ratioValue, tidy} from './parameter.js';

function element(tag, properties = {}, ...children) {
  const node = Object.assign(document.createElement(tag), properties);
  node.append(...children);
  return node;
}

let lastId = 0;

/** A slider with a number field beside it. */
class NumberControl {
  // `place`, `value`: from shown value to slider position and back; `fits` tells whether a typed value is allowed.
  constructor({label, unit, hint, slider, place, value, fits, wrong, onInput}) {
    this.place = place;
    this.fits = fits;
    this.wrong = wrong;
    const id = `control-${++lastId}`;
    this.field = element('input', {type: 'number', id, step: 'any'});
    this.slider = element('input', {type: 'range', ...slider});
    this.slider.setAttribute('aria-label', `${label}, slider`);
    this.field.setAttribute('aria-describedby', `${id}-hint`);
    this.hint = element('span', {className: 'hint', id: `${id}-hint`, textContent: hint});
    this.slider.addEventListener('input', () => {
      this.show(value(Number(this.slider.value)), false);
      onInput(false);
    });
    this.slider.addEventListener('change', () => onInput(true));
    this.field.addEventListener('input', () => {
      if (this.check()) this.slider.value = place(Number(this.field.value));
      onInput(true);
    });
    this.node = element('div', {className: 'control'},
        element('label', {htmlFor: id, textContent: label}),
        element('span', {className: 'number'}, this.field, element('span', {className: 'unit', textContent: unit})),
        this.slider, this.hint);
    this.normalHint = hint;
  }

  check() {
    const value = Number(this.field.value);
    const ok = this.field.value !== '' && Number.isFinite(value) && this.fits(value);
    this.field.setCustomValidity(ok ? '' : this.wrong);
    this.field.setAttribute('aria-invalid', String(!ok));
    this.hint.textContent = ok ? this.normalHint : this.wrong;
    this.hint.classList.toggle('wrong', !ok);
    return ok;
  }

  /** Shows a value in people's units. */
  show(value, moveSlider = true) {
    this.field.value = tidy(value);
    if (moveSlider) this.slider.value = this.place(value);
    this.check();
  }

  get value() {
    return Number(this.field.value);
  }

  set disabled(disabled) {
    this.field.disabled = this.slider.disabled = disabled;
  }
}

/** One of a few values. */
class ChoiceControl {
  constructor({label, unit, values, texts, onInput}) {
    const id = `control-${++lastId}`;
    this.values = values;
    this.field = element('select', {id}, ...texts.map((text, i) => element('option', {value: i, textContent: text})));
    this.field.addEventListener('change', () => onInput(true));
    this.field.disabled = values.length === 1;
    this.node = element('div', {className: 'control choice'}, element('label', {htmlFor: id, textContent: label}),
        element('span', {className: 'number'}, this.field, element('span', {className: 'unit', textContent: unit})),
        element('span', {className: 'hint', textContent: values.length === 1 ? 'fixed by the inspection' : 'one of the inspection’s values'}));
  }

  /** `distance`: of a value of the list from that which is to be shown. */
  showNearest(distance) {
    let best = 0;
    this.values.forEach((value, i) => {
      if (distance(value) < distance(this.values[best])) best = i;
    });
    this.field.value = best;
  }

  get value() {
    return this.values[Number(this.field.value)];
  }

  check() {
    return true;
  }
}

function parameterControl(parameter, onInput) {
  const {label, unit, scale, ranges, values} = parameter;
  if (ranges.length === 0) {
    return new ChoiceControl({label, unit, values, texts: values.map((v) => String(tidy(v * scale))), onInput});
  }
  const min = ranges[0][0] * scale, max = ranges[ranges.length - 1][1] * scale;
  const step = scale === 1 ? 0.5 : 1;
  return new NumberControl({
    label, unit, onInput, hint: allowedText(parameter),
    slider: {min, max, step},
    place: (shown) => shown,
    // A slider passes over values between two ranges.
    value: (place) => nearestAllowed(parameter, place / scale) * scale,
    fits: (shown) => isAllowed(parameter, shown / scale) || (parameter.periodic && isAllowed(parameter, (shown / scale % 360 + 360) % 360)),
    wrong: `must be in ${allowedText(parameter)}`,
  });
}

function settingControl(setting, onInput) {
  const {label, unit, scale, min, max, slider} = setting;
  const text = `${tidy(min * scale)} to ${tidy(max * scale)} ${unit}`.trim();
  return new NumberControl({
    label, unit, onInput, hint: text,
    slider: {min: 0, max: 1, step: 0.005},
    place: (shown) => ratioPlace(Math.min(slider[1], Math.max(slider[0], shown / scale)), slider),
    value: (place) => Number((ratioValue(place, slider) * scale).toPrecision(3)),
    fits: (shown) => shown / scale >= min && shown / scale <= max && shown > 0,
    wrong: `must be in ${text}`,
  });
}

/** All of them. onInput(released): a value has changed; released: it will stay for now. */
export class Controls {
  constructor(setup, parameterBox, settingBox, onInput) {
    this.setup = setup;
    this.parameters = new Map();
    this.settings = new Map();
    this.resting = null;
    const turns = new Set(['part_alpha_deg', 'part_beta_deg']);
    for (const parameter of setup.parameters) {
      if (setup.resting_orientations.length > 0 && turns.has(parameter.name)) {
        if (this.resting) continue;
        this.resting = new ChoiceControl({
          label: 'Resting orientation (α, β)', unit: '°', values: setup.resting_orientations, onInput,
          texts: setup.resting_orientations.map((pair) => pair.map(tidy).join(', ')),
        });
        parameterBox.append(this.resting.node);
        continue;
      }
      const control = parameterControl(parameter, onInput);
      this.parameters.set(parameter.name, control);
      parameterBox.append(control.node);
    }
    for (const setting of setup.settings) {
      const control = settingControl(setting, onInput);
      this.settings.set(setting.name, control);
      settingBox.append(control.node);
    }
  }

  show({measurement, setting}) {
    for (const parameter of this.setup.parameters) {
      const control = this.parameters.get(parameter.name);
      if (!control) continue;
      const value = measurement[parameter.name];
      if (control instanceof ChoiceControl) control.showNearest((v) => Math.abs(v - value));
      else control.show(value * parameter.scale);
    }
    this.resting?.showNearest(([alpha, beta]) =>
      Math.abs(alpha - measurement.part_alpha_deg) + Math.abs(beta - measurement.part_beta_deg));
    if (!setting) return;
    for (const {name, scale} of this.setup.settings) this.settings.get(name).show(setting[name] * scale);
  }

  /** Null while something in a field is not allowed. */
  read() {
    const controls = [...this.parameters.values(), ...this.settings.values()];
    if (!controls.every((control) => control.check())) return null;
    const measurement = {};
    for (const parameter of this.setup.parameters) {
      const {name} = parameter;
      const control = this.parameters.get(name);
      if (!control) continue;
      measurement[name] = control instanceof ChoiceControl ? control.value : exactValue(parameter, control.value);
    }
    if (this.resting) [measurement.part_alpha_deg, measurement.part_beta_deg] = this.resting.value;
    const position = {measurement};
    if (this.setup.settings.length > 0) {
      position.setting = {};
      for (const {name, scale} of this.setup.settings) position.setting[name] = this.settings.get(name).value / scale;
    }
    return position;
  }
}

// Exact value for a shown one: 0.1 mm is 0.0001 m, not 0.00010000000000000002; what rounding for
// people has put just outside a range is its end.
function exactValue(parameter, shown) {
  const value = Number((shown / parameter.scale).toPrecision(12));
  return isAllowed(parameter, value) ? nearestAllowed(parameter, value) : value;
}
