// SPDX-License-Identifier: Apache-2.0
// Pure functions of the reports' viewer. SIGHTLINE_VIEWER is its folder of sources, SIGHTLINE_ESBUILD
// esbuild's program.
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {after, test} from 'node:test';
import {pathToFileURL} from 'node:url';

const folder = mkdtempSync(join(tmpdir(), 'sightline-viewer-'));
after(() => rmSync(folder, {recursive: true}));

const sources = process.env.SIGHTLINE_VIEWER;
writeFileSync(join(folder, 'all.ts'), ['charts/axis_scale', 'charts/number_text', 'charts/plot', 'report_data', 'table']
    .map((module) => `export * from '${join(sources, module)}';\n`).join(''));
execFileSync(process.execPath, [process.env.SIGHTLINE_ESBUILD, join(folder, 'all.ts'), '--bundle', '--format=esm',
  '--log-level=warning', `--outfile=${join(folder, 'all.mjs')}`]);
const {AxisScale, numbersOf, pointText, readReport, shortNumber, tableAsText} =
  await import(pathToFileURL(join(folder, 'all.mjs')).href);

test('numbers are short, with a true minus sign and powers of ten', () => {
  assert.equal(shortNumber(0), '0');
  assert.equal(shortNumber(-0.25), '\u22120.25');
  assert.equal(shortNumber(1200), '1200');
  assert.equal(shortNumber(0.1 + 0.2), '0.3');
  assert.equal(shortNumber(2.5e-7), '2.5\u00b710\u207b\u2077');
  assert.equal(shortNumber(1e6), '10\u2076');
  assert.equal(shortNumber(NaN), '\u2013');
  assert.equal(shortNumber(-Infinity), '\u2212\u221e');
});

test('ticks are round, within the axis and not more than asked for', () => {
  for (const [low, high] of [[0, 1], [-3.7, 12.2], [1e-9, 3e-9], [99999, 100001]]) {
    const scale = new AxisScale({low, high}, [], 0, 400);
    const ticks = scale.ticks(6);
    assert.ok(ticks.length >= 2 && ticks.length <= 7, `${low} to ${high}: ${ticks}`);
    assert.ok(ticks.every((tick) => tick >= low - 1e-9 * Math.abs(low) && tick <= high * (1 + 1e-9)));
  }
  assert.deepEqual(new AxisScale({low: 1, high: 100, logarithmic: true}, [], 0, 400).ticks(3), [1, 10, 100]);
  assert.deepEqual(new AxisScale({low: 1.2, high: 25, logarithmic: true, ticks: [1.4, 2, 2.8, 4, 22]}, [], 0, 500).ticks(8),
      [1.4, 2, 2.8, 4, 22]);
});

test('ticks end even where a step does not change the number', () => {
  const scale = new AxisScale({}, [1e300, 1e300 * (1 + 1e-15)], 0, 400);
  assert.ok(scale.ticks(6).length < 201);
});

test('a scale maps the data between its ends and cuts what lies beyond', () => {
  const scale = new AxisScale({logarithmic: true}, [1, 10, 100, NaN, -5], 50, 450);
  for (const value of [1, 10, 100]) assert.ok(scale.at(value) > 50 && scale.at(value) < 450);
  assert.ok(Math.abs(scale.at(10) - 250) < 1e-9);
  assert.equal(scale.at(1e9), 450);
  assert.equal(scale.drawable(-5), false);
  const none = new AxisScale({}, [], 0, 1);
  assert.ok(none.high > none.low);
});

test('numbers that JSON has no word for are read', () => {
  assert.deepEqual(numbersOf([1, 'NaN', '-Infinity']), [1, NaN, -Infinity]);
  assert.deepEqual(numbersOf(undefined), []);
});

test('what is pointed at has its units', () => {
  const chart = {x: {title: 'row', unit: 'px'}, y: {title: 'signal', unit: 'DN'}};
  assert.equal(pointText(chart, {name: 'observed', x: [3], y: [41.5], notes: ['step 1']}, 0),
      'observed\n3\u202fpx: 41.5\u202fDN\nstep 1');
  assert.equal(pointText({kind: 'RANGES', x: {unit: ''}, y: {categories: ['a', 'b']}}, {x: [2], y: [1]}, 0), 'b: 2');
});

test('damaged reports are refused with a reason', () => {
  assert.throws(() => readReport('{"heading": "x", "sections": ['), SyntaxError);
  assert.throws(() => readReport('[]'), /no JSON object/);
  assert.throws(() => readReport('{}'), /neither/);
  assert.throws(() => readReport('{"heading": "x", "sections": 5}'), /sections is no list/);
  assert.equal(readReport('{"heading": "x"}').heading, 'x');
});

test('a copied table has numbers in full, its units in the head where all cells share them', () => {
  const table = {columns: [{name: 'frame'}, {name: 'rms', unit: 'mm', kind: 'NUMBER'}, {name: 'time', kind: 'NUMBER'}]};
  const rows = [
    {cells: [{text: 'a\tb\nc'}, {text: '0.33', number: 1 / 3}, {text: '5 ms', number: 0.005, unit: 's'}]},
    {cells: [{text: 'd', detail: 'late'}, {text: '\u2013'}, {text: '2 s', number: 2, unit: 's'}]},
  ];
  assert.equal(tableAsText(table, rows),
      `frame\trms [mm]\ttime [s]\na b c\t${1 / 3}\t0.005\nd late\t\u2013\t2\n`);
  rows[1].cells[2].unit = 'ms';
  assert.match(tableAsText(table, rows), /\t0.005 s\n.*\t2 ms\n/);
});
