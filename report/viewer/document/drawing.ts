// SPDX-License-Identifier: Apache-2.0
// Lines to scale.
import {drawn, element} from './elements';
import {Drawing, numberOf, numbersOf, Shape} from './report_data';

function shapeElement(shape: Shape): SVGElement {
  const subject = (shape.subject ?? 'PLAIN').toLowerCase();
  const x = numbersOf(shape.x), y = numbersOf(shape.y);
  const points = x.map((value, i) => `${value.toFixed(1)},${(y[i] ?? 0).toFixed(1)}`).join(' ');
  switch (shape.kind ?? 'LINE') {
    case 'TEXT':
      return drawn('text', {x: x[0] ?? 0, y: y[0] ?? 0}, shape.text ?? '');
    case 'DOT':
      return drawn('circle', {class: subject, cx: x[0] ?? 0, cy: y[0] ?? 0, r: numberOf(shape.radius)});
    case 'AREA':
      return drawn('polygon', {class: subject, points});
    default:
      return drawn('polyline', {class: `${subject} stroke${shape.kind === 'DASHED_LINE' ? ' dashed' : ''}`, points});
  }
}

export function drawingElement(drawing: Drawing): HTMLElement {
  const svg = drawn('svg', {'class': 'drawing', 'viewBox': `0 0 ${numberOf(drawing.width)} ${numberOf(drawing.height)}`,
    'role': 'img', 'aria-label': drawing.alternative || drawing.caption || 'Drawing'});
  svg.append(...(drawing.shapes ?? []).map(shapeElement));
  const figure = element('figure', {class: 'drawing-figure'});
  figure.append(svg);
  if (drawing.caption) figure.append(element('figcaption', {}, drawing.caption));
  return figure;
}
