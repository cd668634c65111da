// SPDX-License-Identifier: Apache-2.0
// Charts as drawings that keep their letters' size at any width, with values on pointing and as a table.
import {AxisScale} from './axis_scale';
import {barSeries, rangeSeries, xySeries} from './chart_series';
import {drawn, element} from '../elements';
import {shortNumber} from './number_text';
import {axisText, chartTitle, Place, Plot} from './plot';
import {Axis, Chart, numberOf, numbersOf, Table} from '../report_data';
import {tableElement} from '../table';

const LEFT = 62, RIGHT = 14, TOP = 10, BOTTOM = 44, ROW_HEIGHT = 26;
const NARROWEST = 240;
const NEAREST_PX = 24;

/** Values that each axis must have room for. */
function extents(chart: Chart): { xs: number[]; ys: number[] } {
  const xs: number[] = [], ys: number[] = [];
  const low = chart.x?.low === undefined ? -Infinity : numberOf(chart.x.low);
  const high = chart.x?.high === undefined ? Infinity : numberOf(chart.x.high);
  for (const line of chart.lines ?? []) (line.along === 'Y' ? xs : ys).push(numberOf(line.at));
  for (const span of chart.spans ?? []) {
    if (chart.kind !== 'BARS') xs.push(numberOf(span.low), numberOf(span.high));
  }
  for (const series of chart.series ?? []) {
    const x = numbersOf(series.x), y = numbersOf(series.y);
    const lows = numbersOf(series.low), highs = numbersOf(series.high);
    xs.push(...x);
    if (chart.kind === 'RANGES') xs.push(...lows, ...highs);
    for (let i = 0; i < x.length; ++i) {
      if (x[i] < low || x[i] > high) continue;
      ys.push(y[i]);
      // A symmetric band may reach to zero and below, where a logarithmic axis has no place.
      if (chart.kind !== 'RANGES' && lows.length > 0 && !(chart.y?.logarithmic && lows[i] <= 0)) {
        ys.push(lows[i], highs[i]);
      }
    }
  }
  // Scatter about 1 shall not look like much.
  if (chart.kind === 'BARS') ys.push(...(chart.y?.logarithmic ? [0.5, 2] : [0]));
  return {xs, ys};
}

function drawXAxis(plot: Plot, chart: Chart): void {
  const {svg, x, left, right, top, bottom} = plot;
  const categories = chart.x?.categories ?? [];
  if (categories.length > 0) {
    const step = (right - left) / categories.length;
    const every = Math.max(1, Math.ceil(26 / Math.max(step, 0.1)));
    categories.forEach((name, i) => {
      if (i % every > 0) return;
      svg.append(drawn('text', {'class': 'tick', 'x': left + (i + 0.5) * step, 'y': bottom + 17, 'text-anchor': 'middle'}, name));
    });
  } else {
    const across = chart.kind === 'RANGES';
    for (const tick of x.ticks(Math.max(2, Math.floor((right - left) / 50)))) {
      const at = x.at(tick);
      svg.append(
          drawn('line', {class: 'grid', x1: at, x2: at, y1: across ? top : bottom, y2: bottom + (across ? 0 : 4)}),
          drawn('text', {'class': 'tick', 'x': at, 'y': bottom + 17, 'text-anchor': 'middle'}, shortNumber(tick)));
    }
  }
  svg.append(drawn('text', {'class': 'axis', 'x': (left + right) / 2, 'y': bottom + 36, 'text-anchor': 'middle'}, axisText(chart.x)));
}

function drawYAxis(plot: Plot, chart: Chart): void {
  const {svg, y, left, right, top, bottom} = plot;
  if (chart.kind === 'RANGES') {
    (chart.y?.categories ?? []).forEach((name, i) => {
      const middle = top + ROW_HEIGHT * (i + 0.5) + 4;
      svg.append(drawn('text', {'class': 'label', 'x': left - 12, 'y': middle, 'text-anchor': 'end'}, name),
          drawn('text', {class: 'note', x: right + 14, y: middle}, chart.y?.category_notes?.[i] ?? ''));
    });
    return;
  }
  for (const tick of y.ticks(Math.max(2, Math.floor((bottom - top) / 34)))) {
    const at = y.at(tick);
    svg.append(drawn('line', {class: 'grid', x1: left, x2: right, y1: at, y2: at}),
        drawn('text', {'class': 'tick', 'x': left - 6, 'y': at + 4, 'text-anchor': 'end'}, shortNumber(tick)));
  }
  const middle = (top + bottom) / 2;
  svg.append(drawn('text', {'class': 'axis', 'x': 12, 'y': middle, 'text-anchor': 'middle',
    'transform': `rotate(-90 12 ${middle})`}, axisText(chart.y)));
}

function drawLinesAndSpans(plot: Plot, chart: Chart): void {
  const {svg, x, y, left, right, top, bottom} = plot;
  for (const span of chart.spans ?? []) {
    const [low, high] = [x.at(numberOf(span.low)), x.at(numberOf(span.high))];
    if (!(high > low)) continue;
    svg.prepend(drawn('rect', {class: 'usual', x: low, y: top, width: high - low, height: bottom - top}));
  }
  for (const line of chart.lines ?? []) {
    const at = numberOf(line.at);
    if (line.along === 'Y' && x.shows(at)) {
      svg.append(drawn('line', {class: 'mark', x1: x.at(at), x2: x.at(at), y1: top, y2: bottom}));
    } else if (line.along !== 'Y' && y.shows(at)) {
      svg.append(drawn('line', {class: 'mark', x1: left, x2: right, y1: y.at(at), y2: y.at(at)}));
    }
  }
}

/** The longest of these texts in the letters of labels, roughly. */
const widthOf = (texts: string[]): number => 6.8 * Math.max(0, ...texts.map((text) => text.length));

function drawChart(chart: Chart, width: number): Plot {
  const ranges = chart.kind === 'RANGES';
  const categories = chart.y?.categories ?? [];
  // Names and remarks leave the data a third of the drawing.
  const left = ranges ? Math.min(width / 3, 24 + widthOf(categories)) : LEFT;
  const right = width - (ranges ? Math.min(width / 3, 28 + widthOf(chart.y?.category_notes ?? [])) : RIGHT);
  const height = ranges ? TOP + ROW_HEIGHT * categories.length + BOTTOM :
    Math.round(Math.min(chart.kind === 'BARS' ? 260 : 380, Math.max(270, 0.36 * width)));
  const bottom = height - BOTTOM;
  const svg = drawn('svg', {'class': 'chart', 'viewBox': `0 0 ${width} ${height}`, 'role': 'img', 'aria-label': chartTitle(chart)});
  const {xs, ys} = extents(chart);
  const bars = chart.kind === 'BARS';
  const xAxis = bars ? {low: -0.5, high: (chart.x?.categories ?? []).length - 0.5} : chart.x ?? {};
  const yAxis = ranges ? {low: -0.5, high: categories.length - 0.5} : chart.y ?? {};
  const plot: Plot = {
    svg, left, right, top: TOP, bottom, places: [],
    x: new AxisScale(xAxis, xs, left, right),
    y: ranges ? new AxisScale(yAxis, [], TOP, bottom) : new AxisScale(yAxis, ys, bottom, TOP),
  };
  drawYAxis(plot, chart);
  drawXAxis(plot, chart);
  drawLinesAndSpans(plot, chart);
  if (ranges) rangeSeries(plot, chart);
  else if (bars) barSeries(plot, chart);
  else xySeries(plot, chart);
  return plot;
}

/** The chart's numbers, one row a point. */
function chartTable(chart: Chart): Table {
  const many = (chart.series ?? []).length > 1;
  const bands = (chart.series ?? []).some((series) => (series.low ?? []).length > 0);
  const names = [axisText(chart.x) || 'x', axisText(chart.y) || 'y'];
  const heads = [...(many ? ['series'] : []), ...names, ...(bands ? ['from', 'to'] : [])];
  const number = (axis: Axis | undefined, value: number): object => {
    const category = axis?.categories?.[value];
    if (category !== undefined) return {text: category};
    return Number.isFinite(value) ? {text: shortNumber(value), number: value} : {text: '\u2013'};
  };
  const rows = (chart.series ?? []).flatMap((series, k) => numbersOf(series.x).map((x, i) => ({cells: [
    ...(many ? [{text: series.name || `${k + 1}`}] : []),
    number(chart.x, x), number(chart.y, numberOf(series.y?.[i])),
    ...(bands ? [series.low, series.high].map((ends) => (ends?.length ? number(undefined, numberOf(ends[i])) : {})) : []),
  ]})));
  return {
    title: `Values of ${chartTitle(chart)}`,
    columns: heads.map((name) => ({name, kind: name === 'series' ? 'TEXT' : 'NUMBER'})),
    rows,
  };
}

/** Shows what is nearest to the pointer. */
function readOnPointing(figure: HTMLElement, plotOf: () => Plot | null): void {
  const bubble = element('div', {'class': 'pointed', 'aria-hidden': 'true'});
  const show = (shown: boolean): void => { bubble.classList.toggle('shown', shown); };
  figure.append(bubble);
  figure.addEventListener('pointerleave', () => show(false));
  figure.addEventListener('pointermove', (event) => {
    const plot = plotOf();
    if (!plot) return;
    const box = plot.svg.getBoundingClientRect();
    const scale = plot.svg.viewBox.baseVal.width / box.width;
    const x = (event.clientX - box.left) * scale, y = (event.clientY - box.top) * scale;
    let nearest: Place | null = null, distance = NEAREST_PX;
    for (const place of plot.places) {
      const away = Math.hypot(place.x - x, place.y - y);
      if (away <= distance) [nearest, distance] = [place, away];
    }
    show(nearest !== null);
    if (!nearest) return;
    bubble.textContent = nearest.text;
    const inFigure = figure.getBoundingClientRect();
    const at = nearest.x / scale + box.left - inFigure.left;
    bubble.style.left = `${Math.min(at + 10, Math.max(0, inFigure.width - bubble.offsetWidth))}px`;
    bubble.style.top = `${Math.max(0, nearest.y / scale + box.top - inFigure.top - bubble.offsetHeight - 8)}px`;
  });
}

/** Drawn as soon as the page has given it a width, and again whenever that changes. */
export function chartElement(chart: Chart): HTMLElement {
  const figure = element('figure', {class: 'chart-figure'});
  if (chart.title) figure.append(element('figcaption', {class: 'chart-title'}, chart.title));
  if (chart.explanation) figure.append(element('p', {class: 'soft'}, chart.explanation));
  const stage = element('div', {class: 'chart-stage'});
  figure.append(stage);
  let plot: Plot | null = null;
  new ResizeObserver(() => {
    const width = Math.max(NARROWEST, Math.round(stage.clientWidth));
    if (stage.clientWidth === 0 || plot?.svg.viewBox.baseVal.width === width) return;
    plot = drawChart(chart, width);
    stage.replaceChildren(plot.svg);
  }).observe(stage);
  readOnPointing(stage.parentElement ?? stage, () => plot);
  const values = element('details', {class: 'values'}, element('summary', {}, 'Values'));
  values.addEventListener('toggle', () => {
    if (values.open && values.childElementCount === 1) values.append(tableElement(chartTable(chart)));
  });
  figure.append(values);
  return figure;
}
