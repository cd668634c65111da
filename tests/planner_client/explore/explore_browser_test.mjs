// SPDX-License-Identifier: Apache-2.0
// The explorer's page in headless Chromium, by real clicks and keys, on a running `sightline explore`.
//
// SIGHTLINE_BIN_DIR, SIGHTLINE_SOURCE_DIR: programs and examples. SIGHTLINE_TEST_PACKAGES: folder with node_modules.
// CHROMIUM: the browser; default /usr/bin/chromium. SIGHTLINE_SCREENSHOTS: folder for pictures.
import assert from 'node:assert/strict';
import {spawn, spawnSync} from 'node:child_process';
import {existsSync, mkdirSync, mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import {join, resolve} from 'node:path';
import {after, before, test} from 'node:test';
import {blockStl} from '../../planning_service/web/test_parts.mjs';

const chromiumPath = process.env.CHROMIUM || '/usr/bin/chromium';
const packages = process.env.SIGHTLINE_TEST_PACKAGES ?? process.cwd();
if (!existsSync(chromiumPath) || !existsSync(join(packages, 'node_modules'))) {
  console.log(`SKIPPED: needs Chromium at ${chromiumPath} (apt-get install chromium, or set CHROMIUM) and npm packages in ${packages}`);
  process.exit(77);
}
const require = createRequire(join(packages, 'package.json'));
const {chromium} = require('playwright-core');
const axePath = require.resolve('axe-core/axe.min.js');

const program = resolve(process.env.SIGHTLINE_BIN_DIR, 'sightline');
const catalogue = resolve(process.env.SIGHTLINE_SOURCE_DIR, 'examples/catalogue');
const folder = mkdtempSync(join(tmpdir(), 'sightline-explore-'));
const plan = join(folder, 'out', 'plan.json');
// For every step on the page. It only ends a test that hangs, and then names the step.
const PAGE_TIMEOUT_MS = 300000;
let context, page;
const troubles = [];
const servers = [];

const imaging = {
  camera: {sensor_file: join(catalogue, 'cameras/bfly_pge_23s6c.json')},
  lens: {focal_length_m: 0.016, f_number: 8, focus_distance_m: 0.15},
  laser: {fan_angle_deg: 60, wavelength_m: 661e-9, power_w: 0.023},
  materials: [{file: join(catalogue, 'materials/cast_aluminium_outer.json')}],
  lighting: {ambient: {radiance_w_m2_sr: 2, spectrum: {illuminant: 'd65'}}},
  render: {exposure_time_s: 0.002},
};

function writeInspection(name, more) {
  const file = join(folder, name);
  writeFileSync(file, JSON.stringify({
    // Without limits on blur: the camera is so near that most of its image is blurred.
    name: 'stepped block', defaults: '0.1', part: {file: 'block.stl', unit: 'mm'}, rig: {stage_travel_m: 0.6, part_holding: 'PART_HOLDING_FREE'},
    targets: {spacing_m: 0.008, coverage_radius_m: 0.005, required_resolution_m: 0},
    // From so near that two scans are not enough.
    measurement: {
      camera_distance_m: {ranges: [{min: 0.12, max: 0.16}]}, camera_polar_deg: {ranges: [{min: 0, max: 40}]},
      triangulation_angle_deg: {values: [-30, 30]}, part_gamma_deg: {ranges: [{min: 0, max: 90}]},
      camera_azimuth_deg: {fixed: 0}, resting_orientations: [{part_alpha_deg: 0, part_beta_deg: 0}, {part_alpha_deg: 180, part_beta_deg: 0}],
    },
    ...more,
  }));
  return file;
}

// Runs `sightline explore` until it says where its page is.
async function explore(args) {
  const process_ = spawn(program, ['explore', ...args, '--listen', '127.0.0.1:0', '--field-directions', '576']);
  const server = {process: process_, output: '', errors: ''};
  servers.push(server);
  server.ended = new Promise((end) => process_.once('exit', (code) => end(code)));
  process_.stderr.on('data', (text) => { server.errors += text; });
  const url = await new Promise((found, failed) => {
    process_.stdout.on('data', (text) => {
      server.output += text;
      const match = /page: +(http\S+)/.exec(server.output);
      if (match) found(match[1]);
    });
    server.ended.then((code) => failed(new Error(`ended with ${code}: ${server.errors}`)));
  });
  return Object.assign(server, {url});
}

let server;
before(async () => {
  writeFileSync(join(folder, 'block.stl'), blockStl());
  server = await explore([writeInspection('inspection.json', imaging), '--out', join(folder, 'out')]);
  context = await chromium.launchPersistentContext(join(folder, 'profile'), {
    executablePath: chromiumPath, headless: true, viewport: {width: 1280, height: 800}, locale: 'en-GB',
    args: ['--headless', '--no-sandbox', '--disable-gpu', '--enable-unsafe-swiftshader', '--no-first-run',
           '--disable-background-networking', '--disable-component-update', '--disable-sync'],
  });
  page = context.pages()[0];
  page.setDefaultTimeout(PAGE_TIMEOUT_MS);
  page.on('pageerror', (error) => troubles.push(`error: ${error.message}`));
  page.on('console', (message) => {
    if (message.type() === 'error' && !/status of (400|409)/.test(message.text())) troubles.push(`console: ${message.text()}`);
  });
  page.on('request', (request) => {
    if (!request.url().startsWith(server.url) && !request.url().startsWith('data:')) troubles.push(`request: ${request.url()}`);
  });
});

after(async () => {
  await context?.close();
  for (const {process: running} of servers) if (running.exitCode === null) running.kill('SIGKILL');
  rmSync(folder, {recursive: true, force: true});
});

const shot = async (name) => {
  if (!process.env.SIGHTLINE_SCREENSHOTS) return;
  mkdirSync(process.env.SIGHTLINE_SCREENSHOTS, {recursive: true});
  await page.screenshot({path: join(process.env.SIGHTLINE_SCREENSHOTS, `${name}.png`)});
};
const exact = () => page.locator('#gain[data-kind=exact]').waitFor();
const gain = () => page.locator('#gain-new').textContent();
const rows = () => page.locator('#scans tr');
const press = (name) => page.getByRole('button', {name, exact: true}).click();
const picture = () => page.locator('#picture-box[data-state=drawn]').waitFor();

// Acts, waits for the answer with exact numbers, and records how long that took.
async function untilExact(what, act) {
  const answered = page.waitForResponse((response) =>
    response.url().endsWith('api/scan') && JSON.parse(response.request().postData()).exact);
  const begun = performance.now();
  await act();
  await answered;
  await exact();
  const inPage = await page.locator('#gain').getAttribute('data-milliseconds');
  console.log(`${what}: exact gain ${inPage} ms after the last move (${(performance.now() - begun).toFixed(0)} ms with the move itself)`);
}

test('a slider changes gain, view and picture', async () => {
  await page.goto(server.url);
  await exact();
  await page.getByRole('heading', {name: 'stepped block'}).waitFor();
  await picture();
  const first = {gain: await gain(), picture: await page.locator('#picture').getAttribute('src')};
  const slider = page.getByLabel('Part offset y, slider');
  const pictured = page.waitForResponse((response) => response.url().endsWith('api/picture'));
  await untilExact('slider by mouse', async () => {
    const box = await slider.boundingBox();
    await page.mouse.click(box.x + 0.56 * box.width, box.y + box.height / 2);
  });
  assert.notEqual(await page.getByLabel('Part offset y', {exact: true}).inputValue(), '0');
  assert.notEqual(await gain(), first.gain);
  assert.equal((await pictured).status(), 200);
  await picture();
  console.log(`picture after ${await page.locator('#picture-box').getAttribute('data-milliseconds')} ms`);
  assert.notEqual(await page.locator('#picture').getAttribute('src'), first.picture);
  assert.match(await page.locator('#picture-note').textContent(), /Draft: .*pixels joined/);
  await slider.focus();
  await untilExact('slider by key', () => page.keyboard.press('ArrowLeft'));
  await untilExact('number field', () => page.getByLabel('Part offset z', {exact: true}).fill('12.5'));
  await shot('slider');
});

test('dragging shows estimates, then the exact number', async () => {
  const kinds = new Set();
  await page.exposeFunction('sawKind', (kind) => { kinds.add(kind); });
  await page.evaluate(() => new MutationObserver(() => window.sawKind(document.getElementById('gain').dataset.kind))
      .observe(document.getElementById('gain'), {attributes: true}));
  const box = await page.getByLabel('Camera distance, slider').boundingBox();
  await untilExact('drag', async () => {
    await page.mouse.move(box.x + 0.3 * box.width, box.y + box.height / 2);
    await page.mouse.down();
    // A page that draws slowly may skip estimates of a fast movement: dragged on until one is shown.
    for (let i = 0; i < 10 || (i < 200 && !kinds.has('estimate')); ++i) {
      await page.mouse.move(box.x + (0.3 + 0.02 * (i % 20)) * box.width, box.y + box.height / 2);
      if (i >= 10) await page.waitForTimeout(100);
    }
    await page.mouse.up();
  });
  assert.ok(kinds.has('estimate') && kinds.has('exact'), [...kinds].join());
});

test('values that are not allowed are told at the field', async () => {
  const field = page.getByLabel('Camera polar angle', {exact: true});
  await field.fill('95');
  await page.getByText('must be in 0 to 40 °').waitFor();
  assert.equal(await field.getAttribute('aria-invalid'), 'true');
  assert.ok(await page.getByRole('button', {name: 'Add this scan'}).isDisabled());
  await untilExact('valid again', () => field.fill('20'));
  assert.equal(await field.getAttribute('aria-invalid'), 'false');
});

test('exposure and f-number change the picture', async () => {
  await page.getByLabel('Exposure time', {exact: true}).fill('0.2');
  await page.waitForResponse((response) => response.url().endsWith('api/picture'));
  await picture();
  const dark = await page.locator('#picture').getAttribute('src');
  await page.getByLabel('Exposure time', {exact: true}).fill('10');
  await page.waitForResponse((response) => response.url().endsWith('api/picture'));
  await picture();
  assert.notEqual(await page.locator('#picture').getAttribute('src'), dark);
  await page.getByLabel('Exposure time', {exact: true}).fill('2');
});

test('five scans are found, added and edited', async () => {
  await page.getByLabel('follows the sliders').uncheck();
  for (let i = 0; i < 5; ++i) {
    const begun = performance.now();
    const answered = page.waitForResponse((response) => response.url().endsWith('api/suggestion') && response.request().method() === 'POST');
    await press('Best next anywhere');
    assert.equal((await answered).status(), 200);
    await page.locator('#suggest-note', {hasText: /found by/}).waitFor();
    console.log(`best next anywhere: ${(performance.now() - begun).toFixed(0)} ms, ${await gain()}`);
    await exact();
    // The number of the scan before is exact too, until the page asks for the new one.
    for (let shown = ''; shown !== await gain(); await page.waitForTimeout(1000)) shown = await gain();
    await exact();
    const fresh = Number((await gain()).slice(1));
    await press('Add this scan');
    await rows().nth(i).waitFor();
    assert.equal(await rows().nth(i).locator('td').nth(1).textContent(), `+${fresh}`);
    await page.locator('#gain-new', {hasText: /^\+0$/}).waitFor();
  }
  assert.equal(await rows().count(), 5);
  const coverage = await page.locator('#coverage').textContent();
  await shot('five_scans');
  // The order does not change what the plan covers.
  await page.getByRole('button', {name: 'Move up scan 2'}).click();
  await page.locator('#saved', {hasText: 'not saved yet'}).waitFor();
  assert.equal(await page.locator('#coverage').textContent(), coverage);
  // In place of a scan its own gain counts; replaced by itself the plan is the same.
  await page.getByRole('button', {name: 'Load into the sliders scan 1'}).click();
  await page.getByText('Gain in place of scan 1').waitFor();
  await exact();
  await press('Replace scan 1');
  await page.getByText('Gain of this scan').waitFor();
  assert.equal(await page.locator('#coverage').textContent(), coverage);
});

test('a search from here can be cancelled and done', async () => {
  await press('Best next from here');
  await page.locator('#suggest-note', {hasText: /found by|searching/}).waitFor();
  await page.locator('#suggest-note', {hasText: /found by/}).waitFor();
  // A search that takes as long as it is let.
  let finish;
  const cancelled = new Promise((done) => { finish = done; });
  await page.route('**/api/suggestion', async (route) => {
    if (route.request().method() !== 'POST') return route.continue();
    await cancelled;
    return route.fulfill({json: {cancelled: true}});
  });
  await press('Best next anywhere');
  const asked = page.waitForResponse((response) => response.url().endsWith('suggestion/cancel'));
  const cancel = page.getByRole('button', {name: 'Cancel', exact: true});
  await cancel.click();
  assert.equal((await asked).status(), 200);
  finish();
  await page.locator('#suggest-note', {hasText: /^cancelled$/}).waitFor();
  await cancel.waitFor({state: 'hidden'});
  await page.unroute('**/api/suggestion');
});

test('nothing is lost when the page is loaded again', async () => {
  await untilExact('before loading again', () => page.getByLabel('Part offset y', {exact: true}).fill('3.5'));
  const coverage = await page.locator('#coverage').textContent();
  await page.reload();
  await exact();
  assert.equal(await page.locator('#coverage').textContent(), coverage);
  assert.equal(await page.getByLabel('Part offset y', {exact: true}).inputValue(), '3.5');
  assert.equal(await rows().count(), 5);
});

test('the saved plan is judged by evaluate with the same number', async () => {
  await press('Save plan');
  await page.locator('#saved', {hasText: 'saved: '}).waitFor();
  const first = readFileSync(plan, 'utf8');
  // Not overwritten without consent.
  await press('Save plan');
  await press('Keep it');
  assert.equal(readFileSync(plan, 'utf8'), first);
  await page.getByRole('button', {name: 'Remove scan 5'}).click();
  await rows().nth(4).waitFor({state: 'detached'});
  await press('Save plan');
  await press('Overwrite');
  await page.locator('#saved', {hasText: 'saved: '}).waitFor();
  const saved = JSON.parse(readFileSync(plan, 'utf8'));
  assert.equal(saved.scans.length, 4);
  assert.equal(saved.scans[0].setting.exposure_time_s, 0.002);
  const shown = await page.locator('#coverage-detail').textContent();
  const checked = spawnSync(program, ['evaluate', join(folder, 'inspection.json'), plan, '--out', join(folder, 'checked'), '--no-pictures', '--no-point-clouds']);
  assert.equal(checked.status, 0, String(checked.stderr));
  const evaluated = JSON.parse(readFileSync(join(folder, 'checked', 'plan.json'), 'utf8'));
  console.log(`saved ${saved.coverage.covered_targets} targets, evaluated ${evaluated.coverage.covered_targets}, shown "${shown}"`);
  assert.equal(evaluated.coverage.covered_targets, saved.coverage.covered_targets);
  assert.ok(shown.startsWith(`${evaluated.coverage.covered_targets} of ${evaluated.coverage.measurable_targets} `));
});

test('the page is accessible', async () => {
  await page.addScriptTag({path: axePath}).catch(() => page.evaluate(readFileSync(axePath, 'utf8')));
  const {violations} = await page.evaluate(() => window.axe.run());
  assert.deepEqual(violations.map(({id, nodes}) => `${id}: ${nodes.map((n) => n.target).join(' ')}`), []);
  // All of it fits the window.
  const overflow = await page.evaluate(() => [document.documentElement.scrollWidth - innerWidth, document.documentElement.scrollHeight - innerHeight]);
  assert.deepEqual(overflow, [0, 0]);
});

test('no errors in the page, and nothing from elsewhere', () => {
  assert.deepEqual(troubles.filter((t) => !/Content Security Policy.*script/.test(t)), []);
});

test('Ctrl-C ends it, and keeps what was not saved', async () => {
  await page.getByRole('button', {name: 'Remove scan 4'}).click();
  await page.locator('#saved', {hasText: 'not saved yet'}).waitFor();
  server.process.kill('SIGINT');
  assert.equal(await server.ended, 0, server.errors);
  assert.match(server.output, /scans that were not saved: .*unsaved_plan\.json/);
  assert.equal(JSON.parse(readFileSync(join(folder, 'out', 'unsaved_plan.json'), 'utf8')).scans.length, 3);
  await page.getByLabel('Part offset y', {exact: true}).fill('4.5');
  await page.getByRole('alert').getByText('The server does not answer').waitFor();
});

test('without materials there are numbers, and the page says what pictures lack', async () => {
  const plain = await explore([writeInspection('plain.json', {}), '--out', join(folder, 'plain'), '--plan', join(folder, 'out', 'unsaved_plan.json')]);
  await page.goto(plain.url);
  await exact();
  assert.equal(await rows().count(), 3);
  await page.getByText(/No picture: .*camera\.sensor_file is missing/).waitFor();
  await page.getByText('The inspection has no lens.').waitFor();
  plain.process.kill('SIGTERM');
  assert.equal(await plain.ended, 0);
});

test('where the goal is uncertainty, the page says what becomes known as evaluate does', async () => {
  const inspection = writeInspection('uncertain.json', {
    uncertainty: {line_detection: {standard_deviation_px: 0.2}}, tolerances: {zone_width_m: 0.0002, relaxed_uncertainty_m: 0.001},
    goal: {admissible: 0.9},
  });
  const uncertain = await explore([inspection, '--out', join(folder, 'uncertain')]);
  await page.goto(uncertain.url);
  await exact();
  await press('Best next anywhere');
  await page.locator('#suggest-cancel').waitFor({state: 'hidden'});
  await page.locator('#admissible[data-kind=exact]').waitFor();
  const said = /^([\d.]+) % → ([\d.]+) % of (\d+)/.exec(await page.locator('#admissible').textContent());
  assert.equal(Number(said[1]), 0);
  assert.ok(Number(said[2]) > 1);
  await shot('uncertainty');
  await press('Add this scan');
  await rows().first().waitFor();
  await press('Save plan');
  await page.locator('#saved', {hasText: 'saved: '}).waitFor();
  const saved = JSON.parse(readFileSync(join(folder, 'uncertain', 'plan.json'), 'utf8')).uncertainty;
  assert.equal((100 * saved.admissible_fraction).toFixed(1), Number(said[2]).toFixed(1));
  assert.equal(saved.judged_targets, Number(said[3]));
  uncertain.process.kill('SIGTERM');
  assert.equal(await uncertain.ended, 0);
});

test('bad input is refused at once', () => {
  const run = (...args) => spawnSync(program, ['explore', ...args]);
  const missing = run(join(folder, 'none.json'));
  assert.equal(missing.status, 2);
  assert.match(String(missing.stderr), /none\.json/);
  const inspection = join(folder, 'plain.json');
  assert.equal(run(inspection, '--plan', join(folder, 'none.json')).status, 2);
  const open = run(inspection, '--listen', '0.0.0.0:0');
  assert.equal(open.status, 2);
  assert.match(String(open.stderr), /--allow-plaintext/);
  assert.equal(run(inspection, '--listen', 'nonsense').status, 2);
});

test('a port in use is told', async () => {
  const holder = await explore([join(folder, 'plain.json'), '--out', join(folder, 'held')]);
  const second = spawnSync(program, ['explore', join(folder, 'plain.json'), '--listen', new URL(holder.url).host]);
  assert.notEqual(second.status, 0);
  assert.match(String(second.stderr), new RegExp(`${new URL(holder.url).port}`));
  holder.process.kill('SIGINT');
  assert.equal(await holder.ended, 0);
});
