// SPDX-License-Identifier: Apache-2.0
// The data of charts: lines, bands, dots, intervals, bars.
import {colourClass} from './chart_key';
import {Place, Plot, pointText} from './plot';
import {drawn} from '../elements';
import {Chart, numbersOf, Series} from '../report_data';

interface Points { series: Series; x: number[]; y: number[]; low: number[]; high: number[] }

const pointsOf = (series: Series): Points => ({
  series, x: numbersOf(series.x), y: numbersOf(series.y), low: numbersOf(series.low), high: numbersOf(series.high),
});

const at = (value: number): string => value.toFixed(1);

/** Points beside the abscissa are left out; those above or below the ordinate are drawn at its end. */
const shows = (plot: Plot, x: number, y: number): boolean =>
  plot.x.drawable(x) && plot.x.shows(x) && plot.y.drawable(y);

function drawBand(plot: Plot, {series, x, low, high}: Points): void {
  let upper: string[] = [], lower: string[] = [];
  const flush = (): void => {
    if (upper.length > 0) {
      plot.svg.append(drawn('path', {class: `band ${colourClass(series)}`, d: `M${[...upper, ...lower.reverse()].join('L')}Z`}));
    }
    [upper, lower] = [[], []];
  };
  x.forEach((value, i) => {
    if (!plot.x.drawable(value) || !plot.x.shows(value) || !Number.isFinite(low[i]) || !Number.isFinite(high[i])) {
      flush();
      return;
    }
    // On a logarithmic axis the band may reach below its end.
    const place = (end: number): string => `${at(plot.x.at(value))} ${at(plot.y.at(Math.max(end, plot.y.low)))}`;
    upper.push(place(high[i]));
    lower.push(place(low[i]));
  });
  flush();
}

function drawLine(plot: Plot, {series, x, y}: Points): void {
  let path = '', gap = true;
  x.forEach((value, i) => {
    if (!shows(plot, value, y[i])) {
      gap = true;
      return;
    }
    path += `${gap ? 'M' : 'L'}${at(plot.x.at(value))} ${at(plot.y.at(y[i]))}`;
    gap = false;
  });
  const dashed = series.mark === 'DASHED_LINE' ? ' dashed' : '';
  if (path) plot.svg.append(drawn('path', {class: `line${dashed} ${colourClass(series)}`, d: path}));
}

function drawDots(plot: Plot, {series, x, y}: Points): void {
  const css = series.mark === 'HOLLOW_DOTS' ? 'hollow' : series.mark === 'RINGS' ? 'ring' : 'dot';
  // Many dots are small dots.
  const r = series.mark === 'RINGS' ? 7 : x.length > 60 ? 1.8 : 3.2;
  x.forEach((value, i) => {
    if (!shows(plot, value, y[i])) return;
    const dot = drawn('circle', {class: `${css} ${colourClass(series)}`, cx: plot.x.at(value), cy: plot.y.at(y[i]), r});
    if (series.of_scans) dot.dataset.scan = String(i + 1);
    plot.svg.append(dot);
  });
}

/** Above its dot, or below where there is a dot or another label. */
function drawLabels(plot: Plot, {series, x, y}: Points): void {
  const character = 7.5, halfHeight = 6, away = 14;
  const taken: { x: number; y: number; halfWidth: number; halfHeight: number }[] = [];
  const labels = series.labels ?? [];
  labels.forEach((_, i) => {
    if (shows(plot, x[i], y[i])) taken.push({x: plot.x.at(x[i]), y: plot.y.at(y[i]), halfWidth: 4, halfHeight: 4});
  });
  labels.forEach((text, i) => {
    if (!shows(plot, x[i], y[i])) return;
    for (const shift of [-away, away]) {
      const box = {x: plot.x.at(x[i]), y: plot.y.at(y[i]) + shift, halfWidth: character * text.length / 2, halfHeight};
      if (taken.some((other) => Math.abs(other.x - box.x) < other.halfWidth + box.halfWidth &&
          Math.abs(other.y - box.y) < other.halfHeight + box.halfHeight)) {
        continue;
      }
      taken.push(box);
      plot.svg.append(drawn('text', {'class': 'label', 'x': box.x, 'y': box.y + 4, 'text-anchor': 'middle'}, text));
      break;
    }
  });
}

export function xySeries(plot: Plot, chart: Chart): void {
  const all = (chart.series ?? []).map(pointsOf);
  for (const points of all) {
    if (points.low.length > 0) drawBand(plot, points);
  }
  for (const points of all) {
    const mark = points.series.mark ?? 'LINE';
    const lines = ['LINE', 'DASHED_LINE', 'LINE_AND_DOTS'].includes(mark);
    if (lines) drawLine(plot, points);
    if (!lines || mark === 'LINE_AND_DOTS') drawDots(plot, points);
    drawLabels(plot, points);
    points.x.forEach((x, i) => {
      if (!shows(plot, x, points.y[i])) return;
      plot.places.push({x: plot.x.at(x), y: plot.y.at(points.y[i]), text: pointText(chart, points.series, i)});
    });
  }
}

export function rangeSeries(plot: Plot, chart: Chart): void {
  const all = (chart.series ?? []).map(pointsOf);
  const place = (points: Points, k: number, i: number): Place => ({
    x: plot.x.at(points.x[i]),
    // Marks of one category stand one above the other, unless a line joins them.
    y: plot.y.at(points.y[i]) + (chart.joined ? 0 : 8 * (k - (all.length - 1) / 2)),
    text: pointText(chart, points.series, i),
  });
  if (chart.joined) {
    (chart.y?.categories ?? []).forEach((_, category) => {
      const xs = all.flatMap((points) => points.x.filter((x, i) => points.y[i] === category && plot.x.drawable(x)));
      if (xs.length < 2) return;
      plot.svg.append(drawn('line', {class: 'joint', x1: plot.x.at(xs[0]), x2: plot.x.at(xs[xs.length - 1]),
        y1: plot.y.at(category), y2: plot.y.at(category)}));
    });
  }
  all.forEach((points, k) => points.x.forEach((x, i) => {
    if (!plot.x.drawable(x)) return;
    const mark = place(points, k, i), css = colourClass(points.series);
    if (Number.isFinite(points.low[i]) && Number.isFinite(points.high[i])) {
      plot.svg.append(drawn('line', {class: `interval ${css}`, x1: plot.x.at(points.low[i]), x2: plot.x.at(points.high[i]),
        y1: mark.y, y2: mark.y}));
    }
    plot.svg.append(drawn('circle', {class: `dot ${css}`, cx: mark.x, cy: mark.y, r: 3.8}));
    plot.places.push(mark);
  }));
}

export function barSeries(plot: Plot, chart: Chart): void {
  const all = (chart.series ?? []).map(pointsOf);
  const step = (plot.right - plot.left) / Math.max(1, chart.x?.categories?.length ?? 1);
  const width = 0.76 * step / Math.max(1, all.length);
  const base = plot.y.at(chart.y?.logarithmic ? 1 : 0);
  all.forEach((points, k) => points.x.forEach((category, i) => {
    if (!plot.y.drawable(points.y[i])) return;
    const left = plot.left + step * category + 0.12 * step + width * k, end = plot.y.at(points.y[i]);
    plot.svg.append(drawn('rect', {class: `bar ${colourClass(points.series)}`, x: left, y: Math.min(base, end),
      width: Math.max(0.5, 0.94 * width), height: Math.max(0.5, Math.abs(base - end))}));
    plot.places.push({x: left + width / 2, y: end, text: pointText(chart, points.series, i)});
  }));
}
