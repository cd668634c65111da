// SPDX-License-Identifier: Apache-2.0
// The messages of report.proto as their JSON form has them: what has its default value is left out.

/** proto3 JSON writes numbers that are not finite as text. */
export type JsonNumber = number | 'NaN' | 'Infinity' | '-Infinity';

export interface Run { text?: string; strong?: boolean; code?: boolean; link?: string }
export interface Paragraph { runs?: Run[]; remark?: boolean }
export interface Fact { name?: string; text?: string; number?: JsonNumber; unit?: string; detail?: string }
export interface Column { name?: string; unit?: string; kind?: 'TEXT' | 'NUMBER' | 'SHARE'; help?: string; group?: string }
export interface Picture { png?: string; caption?: string; alternative?: string; pixels?: boolean }
export interface Cell {
  text?: string;
  number?: JsonNumber;
  unit?: string;
  detail?: string;
  strong?: boolean;
  state?: string;
  picture?: Picture;
  reason?: number;
}
export interface View { scan?: number; unmeasured_region?: number; feature?: number }
export interface Row { cells?: Cell[]; state?: string; view?: View }
export interface Table { title?: string; columns?: Column[]; rows?: Row[] }

export interface Axis {
  title?: string;
  unit?: string;
  logarithmic?: boolean;
  whole_numbers?: boolean;
  low?: JsonNumber;
  high?: JsonNumber;
  ticks?: JsonNumber[];
  categories?: string[];
  category_notes?: string[];
}
export type Mark = 'LINE' | 'DASHED_LINE' | 'DOTS' | 'HOLLOW_DOTS' | 'LINE_AND_DOTS' | 'RINGS';
export interface Series {
  name?: string;
  colour?: string;
  hue?: number;
  mark?: Mark;
  x?: JsonNumber[];
  y?: JsonNumber[];
  low?: JsonNumber[];
  high?: JsonNumber[];
  band_name?: string;
  labels?: string[];
  notes?: string[];
  of_scans?: boolean;
}
export interface Chart {
  kind?: 'XY' | 'RANGES' | 'BARS';
  title?: string;
  explanation?: string;
  x?: Axis;
  y?: Axis;
  series?: Series[];
  lines?: { along?: 'X' | 'Y'; at?: JsonNumber; name?: string }[];
  spans?: { low?: JsonNumber; high?: JsonNumber; name?: string }[];
  joined?: boolean;
}
export interface ValueMap {
  title?: string;
  rows?: number;
  columns?: number;
  row_edges_px?: JsonNumber[];
  column_edges_px?: JsonNumber[];
  values?: JsonNumber[];
  value_name?: string;
  levels?: JsonNumber[];
}
export interface Note { severity?: string; text?: string }
export interface Shape {
  kind?: 'LINE' | 'DASHED_LINE' | 'AREA' | 'DOT' | 'TEXT';
  subject?: 'PLAIN' | 'PART' | 'CAMERA' | 'LASER' | 'AXIS';
  x?: JsonNumber[];
  y?: JsonNumber[];
  text?: string;
  radius?: JsonNumber;
}
export interface Drawing { alternative?: string; caption?: string; width?: JsonNumber; height?: JsonNumber; shapes?: Shape[] }
/** Read by data.js. */
export type Scene = Record<string, unknown>;
export interface Group {
  title?: string;
  subtitle?: string;
  layout?: 'STACK' | 'TWO_COLUMNS' | 'THREE_COLUMNS' | 'FOUR_COLUMNS' | 'ROW';
  framed?: boolean;
  folded?: boolean;
  blocks?: Block[];
}
export interface Block {
  paragraph?: Paragraph;
  list?: { items?: Paragraph[]; numbered?: boolean };
  facts?: { facts?: Fact[] };
  table?: Table;
  chart?: Chart;
  map?: ValueMap;
  picture?: Picture;
  note?: Note;
  group?: Group;
  scene?: Scene;
  drawing?: Drawing;
}
export interface Section { id?: string; title?: string; blocks?: Block[]; narrow?: boolean; new_page?: boolean }
export interface Report {
  title?: string;
  kind?: string;
  subject?: string;
  heading?: string;
  finding?: Run[];
  figures?: Fact[];
  warnings?: string[];
  sections?: Section[];
}

/** Reads report.json. Throws an Error that says what is wrong with the text. */
export function readReport(text: string): Report {
  const read: unknown = JSON.parse(text);
  if (typeof read !== 'object' || read === null || Array.isArray(read)) {
    throw new Error('it is no JSON object');
  }
  const report = read as Report;
  for (const field of ['finding', 'figures', 'warnings', 'sections'] as const) {
    if (report[field] !== undefined && !Array.isArray(report[field])) throw new Error(`${field} is no list`);
  }
  if (report.heading === undefined && report.sections === undefined) {
    throw new Error('it has neither a heading nor sections');
  }
  return report;
}

export const numberOf = (value: JsonNumber | undefined): number => (value === undefined ? 0 : Number(value));
export const numbersOf = (values: JsonNumber[] | undefined): number[] => (values ?? []).map(numberOf);
