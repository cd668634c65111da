// SPDX-License-Identifier: Apache-2.0
// A chart while it is drawn, and its texts.
import {Axis, Chart, numberOf, Series} from '../report_data';
import {AxisScale} from './axis_scale';
import {shortNumber} from './number_text';

/** A place that can be pointed at. */
export interface Place { x: number; y: number; text: string }

/** Elements of a drawing, and the area of the data. */
export interface Plot {
  svg: SVGSVGElement;
  x: AxisScale;
  y: AxisScale;
  left: number;
  right: number;
  top: number;
  bottom: number;
  places: Place[];
}

/** Title, unit, and whether it is logarithmic. */
export const axisText = (axis: Axis | undefined): string =>
  [axis?.title, axis?.unit ? `[${axis.unit}]` : ''].filter(Boolean).join(' ') + (axis?.logarithmic ? ', log' : '');

export function chartTitle(chart: Chart): string {
  return chart.title || `${axisText(chart.y)} against ${axisText(chart.x)}`;
}

/** Text about the point under the pointer: name of the series, values with their units, and the note. */
export function pointText(chart: Chart, series: Series, i: number): string {
  const value = (axis: Axis | undefined, at: number): string => {
    const category = axis?.categories?.[at];
    return category ?? [shortNumber(at, 5), axis?.unit].filter(Boolean).join('\u202f');
  };
  const x = numberOf(series.x?.[i]), y = numberOf(series.y?.[i]);
  const note = series.notes?.[i];
  const values = chart.kind === 'RANGES' ? `${value(chart.y, y)}: ${value(chart.x, x)}` :
    `${value(chart.x, x)}: ${value(chart.y, y)}`;
  return [series.name, values, note].filter(Boolean).join('\n');
}
