// SPDX-License-Identifier: Apache-2.0
// Numbers over the image in colours: orange above 0, blue below, deeper by levels.
import {AxisScale} from './axis_scale';
import {drawn, element} from '../elements';
import {shortNumber} from './number_text';
import {numbersOf, ValueMap} from '../report_data';

const WIDTH = 400, LEFT = 46, RIGHT = 6, TOP = 4, BOTTOM = 38;

const levelOf = (value: number, levels: number[]): number => {
  const level = levels.filter((least) => Math.abs(value) >= least).length;
  return value < 0 ? -level : level;
};
const levelClass = (level: number): string => `${level < 0 ? 'less' : 'more'}${Math.abs(level)}`;

const edges = (given: number[], count: number): number[] =>
  (given.length === count + 1 ? given : [...Array(count + 1).keys()]);

/** One path a colour; neighbours of one colour in a row are one rectangle. */
function paths(map: ValueMap, x: AxisScale, y: AxisScale, columns: number[], rows: number[]): Map<number, string> {
  const values = numbersOf(map.values), levels = numbersOf(map.levels), count = map.columns ?? 0;
  const result = new Map<number, string>();
  const at = (value: number): string => value.toFixed(1);
  for (let row = 0; row + 1 < rows.length; ++row) {
    for (let column = 0; column < count;) {
      const value = values[row * count + column];
      let end = column + 1;
      if (Number.isFinite(value)) {
        const level = levelOf(value, levels);
        const same = (next: number): boolean => Number.isFinite(next) && levelOf(next, levels) === level;
        while (end < count && same(values[row * count + end])) ++end;
        result.set(level, `${result.get(level) ?? ''}M${at(x.at(columns[column]))} ${at(y.at(rows[row]))}` +
          `H${at(x.at(columns[end]))}V${at(y.at(rows[row + 1]))}H${at(x.at(columns[column]))}Z`);
      }
      column = end;
    }
  }
  return result;
}

export function mapElement(map: ValueMap): HTMLElement {
  const rows = edges(numbersOf(map.row_edges_px), map.rows ?? 0);
  const columns = edges(numbersOf(map.column_edges_px), map.columns ?? 0);
  const inPx = Boolean(map.row_edges_px?.length && map.column_edges_px?.length);
  const [firstX, lastX, firstY, lastY] = [columns[0], columns[columns.length - 1], rows[0], rows[rows.length - 1]];
  const plotWidth = WIDTH - LEFT - RIGHT;
  // The map has the proportions of the image, as long as that can be read.
  const plotHeight = Math.min(420, Math.max(120, plotWidth * (lastY - firstY) / Math.max(lastX - firstX, 1e-9)));
  const bottom = TOP + plotHeight;
  const x = new AxisScale({low: firstX, high: lastX}, [], LEFT, WIDTH - RIGHT);
  const y = new AxisScale({low: firstY, high: lastY}, [], TOP, bottom);
  const svg = drawn('svg', {'class': 'chart map', 'viewBox': `0 0 ${WIDTH} ${Math.round(bottom + BOTTOM)}`, 'role': 'img',
    'aria-label': map.title ?? 'Map'});
  svg.append(drawn('rect', {class: 'no-data', x: LEFT, y: TOP, width: plotWidth, height: plotHeight}));
  for (const [level, d] of paths(map, x, y, columns, rows)) svg.append(drawn('path', {class: levelClass(level), d}));
  for (const tick of y.ticks(Math.max(2, Math.floor(plotHeight / 44)))) {
    svg.append(drawn('text', {'class': 'tick', 'x': LEFT - 6, 'y': y.at(tick) + 4, 'text-anchor': 'end'}, shortNumber(tick)));
  }
  for (const tick of x.ticks(6)) {
    svg.append(drawn('text', {'class': 'tick', 'x': x.at(tick), 'y': bottom + 15, 'text-anchor': 'middle'}, shortNumber(tick)));
  }
  const middle = (TOP + bottom) / 2;
  svg.append(
      drawn('text', {'class': 'axis', 'x': (LEFT + WIDTH - RIGHT) / 2, 'y': bottom + 32, 'text-anchor': 'middle'},
          inPx ? 'column [px]' : 'column block'),
      drawn('text', {'class': 'axis', 'x': 11, 'y': middle, 'text-anchor': 'middle', 'transform': `rotate(-90 11 ${middle})`},
          inPx ? 'row [px]' : 'row block'));
  const figure = element('figure', {class: 'map-figure'});
  if (map.title) figure.append(element('figcaption', {}, map.title));
  figure.append(svg);
  return figure;
}

/** The colours of a map's levels. */
export function mapKey(map: ValueMap): HTMLElement {
  const cell = 30, height = 14, levels = numbersOf(map.levels), deepest = levels.length;
  const svg = drawn('svg', {'class': 'map-key', 'viewBox': `0 0 ${cell * (2 * deepest + 1)} 34`, 'role': 'img',
    'aria-label': `Colours of the ${map.value_name ?? 'values'}`});
  for (let level = -deepest; level <= deepest; ++level) {
    const left = cell * (level + deepest);
    svg.append(drawn('rect', {class: levelClass(level), x: left, y: 0, width: cell, height}));
    // The value at the border towards 0.
    if (level === 0) continue;
    svg.append(drawn('text', {'class': 'tick', 'x': level < 0 ? left + cell : left, 'y': 29, 'text-anchor': 'middle'},
        shortNumber(Math.sign(level) * levels[Math.abs(level) - 1])));
  }
  return element('div', {class: 'map-key-line'}, svg);
}
