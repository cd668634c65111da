// SPDX-License-Identifier: Apache-2.0
// The key of charts: what colours and marks mean.
import {drawn, element} from '../elements';
import {Chart, Series} from '../report_data';

export const colourClass = (series: Series): string => {
  const name = (series.colour ?? '').replace('REPORT_COLOUR_', '').toLowerCase();
  if (name === 'in_order') return `hue${Math.min(11, Math.max(0, Math.round(series.hue ?? 0)))}`;
  return name === '' || name === 'unspecified' ? 'neutral' : name;
};

interface Entry { colour: string; shape: string; text: string }

function entriesOf(chart: Chart): Entry[] {
  const entries: Entry[] = [];
  for (const series of chart.series ?? []) {
    const colour = colourClass(series);
    const shape = chart.kind === 'BARS' ? 'BOX' : chart.kind === 'RANGES' ? 'DOTS' : series.mark ?? 'LINE';
    if (series.name) entries.push({colour, shape, text: series.name});
    if (series.band_name) entries.push({colour, shape: 'BAND', text: series.band_name});
  }
  for (const line of chart.lines ?? []) {
    if (line.name) entries.push({colour: 'across', shape: 'ACROSS', text: line.name});
  }
  for (const span of chart.spans ?? []) {
    if (span.name) entries.push({colour: 'usual', shape: 'SPAN', text: span.name});
  }
  return entries;
}

function sign({colour, shape}: Entry): SVGElement[] {
  const line = (css: string): SVGElement => drawn('path', {class: `${css} ${colour}`, d: 'M1 6H23'});
  const dot = (css: string, r: number): SVGElement => drawn('circle', {class: `${css} ${colour}`, cx: 12, cy: 6, r});
  switch (shape) {
    case 'DASHED_LINE': return [line('line dashed')];
    case 'DOTS': return [dot('dot', 4)];
    case 'HOLLOW_DOTS': return [dot('hollow', 4)];
    case 'LINE_AND_DOTS': return [line('line'), dot('dot', 3)];
    case 'RINGS': return [dot('ring', 5)];
    case 'BAND': return [drawn('path', {class: `band ${colour}`, d: 'M0 1H24V11H0Z'})];
    case 'BOX': return [drawn('rect', {class: `bar ${colour}`, x: 5, y: 0, width: 12, height: 12})];
    case 'SPAN': return [drawn('rect', {class: 'usual', x: 0, y: 0, width: 24, height: 12})];
    case 'ACROSS': return [drawn('path', {class: 'mark', d: 'M1 6H23'})];
    default: return [line('line')];
  }
}

/** One key for all of these charts; a name that several series have stands there once. Null: nothing to say. */
export function chartKey(charts: Chart[]): HTMLElement | null {
  const entries = new Map<string, Entry>();
  for (const entry of charts.flatMap(entriesOf)) {
    if (!entries.has(entry.text)) entries.set(entry.text, entry);
  }
  if (entries.size === 0) return null;
  return element('p', {class: 'chart-key'}, ...[...entries.values()].map((entry) => {
    const drawing = drawn('svg', {'class': 'chart', 'viewBox': '0 0 24 12', 'aria-hidden': 'true'});
    drawing.append(...sign(entry));
    return element('span', {}, drawing, ` ${entry.text}`);
  }));
}
