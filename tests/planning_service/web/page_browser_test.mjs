// SPDX-License-Identifier: Apache-2.0
// The page in headless Chromium, by real clicks and keys.
//
// SIGHTLINE_WEB_PAGE: folder of the page's files, served by the stand-in mock_server.mjs.
// SIGHTLINE_SERVE_URL: address of a running `sightline serve` instead; what only the stand-in can do
// (lose an answer, ask for a token) is left out then.
// CHROMIUM: the browser; default /usr/bin/chromium. SIGHTLINE_SCREENSHOTS: folder for pictures.
import assert from 'node:assert/strict';
import {existsSync, mkdtempSync, readFileSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';
import {after, before, beforeEach, test} from 'node:test';
import {createRequire} from 'node:module';
import {startMockServer} from './mock_server.mjs';
import {blockStl, tetrahedronGlb, tetrahedronObj, tetrahedronPly} from './test_parts.mjs';

const chromiumPath = process.env.CHROMIUM || '/usr/bin/chromium';
if (!existsSync(chromiumPath)) {
  console.log(`SKIPPED: there is no Chromium at ${chromiumPath} (apt-get install chromium, or set CHROMIUM)`);
  process.exit(77);
}
// Packages of the build tree, where npm has put them.
const require = createRequire(join(process.env.SIGHTLINE_TEST_PACKAGES ?? process.cwd(), 'package.json'));
const {chromium} = require('playwright-core');
const axePath = require.resolve('axe-core/axe.min.js');

// For every step on the page. It only ends a test that hangs, and then names the step.
const PAGE_TIMEOUT_MS = 300000;
const PLAIN_ERRORS = /status of (400|401|404|409)/;
const needsMock = {skip: process.env.SIGHTLINE_SERVE_URL ? 'needs the stand-in' : false};
let mock = null, url, context, page, profile, troubles;

before(async () => {
  url = process.env.SIGHTLINE_SERVE_URL;
  if (!url) {
    mock = await startMockServer({pageFolder: process.env.SIGHTLINE_WEB_PAGE});
    url = mock.url;
  }
  if (!url.endsWith('/')) url += '/';
  profile = mkdtempSync(join(tmpdir(), 'sightline-page-'));
  context = await chromium.launchPersistentContext(profile, {
    executablePath: chromiumPath, headless: true, viewport: {width: 1320, height: 900}, acceptDownloads: true,
    locale: 'en-GB', args: ['--headless', '--no-sandbox', '--disable-gpu', '--enable-unsafe-swiftshader', '--disable-quic', '--no-first-run',
                            '--disable-background-networking', '--disable-component-update', '--disable-sync'],
  });
});

after(async () => {
  await context?.close();
  await mock?.close();
  if (profile) rmSync(profile, {recursive: true, force: true});
});

beforeEach(async () => {
  for (const old of context.pages().slice(1)) await old.close();
  const last = context.pages()[0];
  page = await context.newPage();
  await last?.close();
  page.setDefaultTimeout(PAGE_TIMEOUT_MS);
  troubles = [];
  page.on('pageerror', (error) => troubles.push(`error: ${error.message}`));
  page.on('console', (message) => {
    if (message.type() === 'error' && !PLAIN_ERRORS.test(message.text()) && !/ERR_(INCOMPLETE|EMPTY_RESPONSE|CONNECTION)/.test(message.text())) {
      troubles.push(`console: ${message.text()}`);
    }
  });
  // Nothing may be loaded from elsewhere.
  page.on('request', (request) => {
    if (!request.url().startsWith(url) && !request.url().startsWith(`blob:${url}`)) troubles.push(`request: ${request.url()}`);
  });
  if (mock) Object.assign(mock.settings, {loseAnswers: 0, cutStreams: true, endsWhenRead: false, token: ''});
});

const noTroubles = () => assert.deepEqual(troubles, []);
const shot = async (name) => {
  if (process.env.SIGHTLINE_SCREENSHOTS) {
    await page.screenshot({path: join(process.env.SIGHTLINE_SCREENSHOTS, `${name}.png`), fullPage: true});
  }
};
const open = (hash = '') => page.goto(url + hash);
const choose = (name, buffer) => page.locator('#file-input').setInputFiles({name, mimeType: 'application/octet-stream', buffer});
const field = (label) => page.getByLabel(label, {exact: false}).and(page.locator('input:visible')).first();
const submit = () => page.getByRole('button', {name: 'Submit job'}).click();
const state = (word) => page.locator('.job-view .job-state', {hasText: word});

async function until(holds, what) {
  for (const end = Date.now() + 30000; !await holds();) {
    assert.ok(Date.now() < end, what);
    await new Promise((resolve) => setTimeout(resolve, 20));
  }
}

async function chooseBlock(name = 'block.stl') {
  await choose(name, blockStl());
  await page.locator('.units label', {hasText: '120 × 80 × 40 mm'}).click();
}

// Submits a plan of one scan, as small as can be.
async function submitSmallPlan(name) {
  await open('#/new');
  await chooseBlock();
  await field('Name of the inspection').fill(name);
  await field('Most scans').fill('1');
  await field('Target spacing').fill('20');
  await field('Coverage radius').fill('10');
  await page.locator('summary', {hasText: 'Search'}).click();
  await field('Evaluations per scan').fill('50');
  await field('Effort of the lower bound').fill('0');
  await page.getByLabel('Leave the pictures out').check();
  await submit();
  await page.waitForURL(/#\/jobs\/.+/);
}

test('a part is uploaded, planned and reported', async () => {
  if (mock) mock.settings.endsWhenRead = true;
  await open();
  await chooseBlock();
  await page.locator('.facts', {hasText: '120 × 80 × 40 mm'}).waitFor();
  // A wrong unit is seen.
  await page.locator('.units label', {hasText: '3048 × 2032 × 1016 mm'}).click();
  await page.locator('.facts', {hasText: '3048 × 2032 × 1016 mm'}).waitFor();
  await shot('part_wrong_unit');
  await submitSmallPlan('stepped block');
  await state(/running|done/).waitFor();
  await shot('job_running');
  await state('done').waitFor();
  await shot('job_done');
  if (mock) {
    assert.deepEqual(mock.posts.at(-1).files, ['block.stl']);
    const {kind, inspection} = mock.posts.at(-1).task;
    assert.equal(kind, 'plan');
    assert.deepEqual(inspection.part, {file: 'block.stl', unit: 'mm'});
    assert.deepEqual(inspection.targets, {spacing_m: 0.02, coverage_radius_m: 0.01});
    // Streams that begin at the first event were cut after two; the last one asked for what came
    // after those that the page had read.
    const requests = mock.eventRequests.filter(({job}) => job === mock.jobs[0].shown.job_id);
    const ids = requests.map(({after: id}) => id);
    assert.deepEqual(ids.slice(0, -1), ids.slice(0, -1).fill(0));
    assert.ok(ids.length >= 2 && [1, 2].includes(ids.at(-1)), `asked for events after ${ids}`);
  }
  const opened = context.waitForEvent('page');
  await page.getByRole('link', {name: 'Open the report'}).click();
  const report = await opened;
  await report.locator('h1').filter({hasNotText: 'no script'}).first().waitFor();
  await report.close();
  const download = page.waitForEvent('download');
  await page.getByRole('link', {name: 'plan.json'}).click();
  assert.equal((await download).suggestedFilename(), 'plan.json');
  noTroubles();
});

test('an error is shown at its field, in the field’s unit', async () => {
  await open();
  await chooseBlock();
  await field('Scan step').fill('500');
  await submit();
  const input = field('Scan step');
  await page.locator('.summary', {hasText: 'Scan step'}).waitFor();
  assert.equal(await input.getAttribute('aria-invalid'), 'true');
  assert.match(await page.locator('#field-inspection-rig-scan_step_m-error').innerText(), /is 500, must be in \[0\.01, 100\] mm/);
  assert.ok(await input.evaluate((element) => element === document.activeElement));
  await shot('field_error');
  // Mended, the mark goes.
  await input.fill('1');
  assert.equal(await input.getAttribute('aria-invalid'), null);
  noTroubles();
});

test('what cannot be read is not sent', async () => {
  await open();
  await submit();
  await page.locator('.summary', {hasText: 'Choose the part.'}).waitFor();
  await choose('block.stl', blockStl());
  await field('Pixel size').fill('about 5');
  await submit();
  await page.locator('.summary', {hasText: 'Choose the unit'}).waitFor();
  await page.locator('.summary', {hasText: '“about 5” is not a number'}).waitFor();
  await page.getByRole('button', {name: /Pixel size/}).click();
  assert.ok(await field('Pixel size').evaluate((element) => element === document.activeElement));
  noTroubles();
});

test('an error of what the form does not show is at the JSON', async () => {
  await open();
  await chooseBlock();
  await choose('table.stl', blockStl());
  await page.locator('#json-card summary').click();
  // A second mesh took the part's place: the JSON names both.
  await page.locator('#json').fill(JSON.stringify({
    part: {file: 'block.stl', unit: 'mm'}, obstacles: [{name: 'table', file: 'table.stl', unit: 'mm'}],
  }));
  await choose('block.stl', blockStl());
  await submit();
  await page.locator('#json-error', {hasText: 'inspection.obstacles[0].frame'}).waitFor();
  noTroubles();
});

test('form and JSON stay in step', async () => {
  await open();
  await page.locator('#json-card summary').click();
  const json = page.locator('#json');
  const inspection = async () => JSON.parse(await json.inputValue());
  await field('Pixel size').fill('5.5');
  await field('Camera working distance').fill('200 to 500');
  assert.deepEqual(await inspection(), {
    camera: {pixel_pitch_m: 5.5e-6}, measurement: {camera_distance_m: {ranges: [{min: 0.2, max: 0.5}]}},
  });
  // The angle of view follows from pixel size, rows and focal length.
  await field('Focal length').fill('16');
  assert.equal((await inspection()).camera.vertical_fov_deg, 10.058);
  await field('Rows').fill('1024');
  assert.equal((await inspection()).camera.vertical_fov_deg, 19.964);
  await json.fill('{"rig": {"scan_step_m": 0.0005, "camera_bodies": []}, "goal": {"coverage": 0.9}}');
  assert.equal(await field('Scan step').inputValue(), '0.5');
  assert.equal(await page.locator('#field-inspection-goal-coverage').inputValue(), '90');
  assert.equal(await field('Pixel size').inputValue(), '');
  // Fields that the form does not know are kept.
  await field('Scan step').fill('2');
  assert.deepEqual(await inspection(), {rig: {scan_step_m: 0.002, camera_bodies: []}, goal: {coverage: 0.9}});
  await json.fill('{"rig": ');
  await page.locator('#json-error').waitFor();
  assert.ok(await field('Scan step').isDisabled());
  await page.getByRole('button', {name: 'Back to what the form has'}).click();
  assert.ok(await field('Scan step').isEnabled());
  assert.deepEqual(await inspection(), {rig: {scan_step_m: 0.002, camera_bodies: []}, goal: {coverage: 0.9}});
  noTroubles();
});

test('a running job is cancelled after a question', async () => {
  await open();
  await chooseBlock();
  // As much work as can be asked for.
  await field('Target spacing').fill('0.5');
  await submit();
  await page.waitForURL(/#\/jobs\/.+/);
  await state(/queued|running/).waitFor();
  await page.getByRole('button', {name: 'Cancel job …'}).click();
  await shot('cancel');
  await page.getByRole('button', {name: 'Keep it'}).click();
  await state(/queued|running/).waitFor();
  await page.getByRole('button', {name: 'Cancel job …'}).click();
  await page.getByRole('dialog').getByRole('button', {name: 'Cancel job'}).click();
  await state('cancelled').waitFor();
  assert.equal(await page.getByRole('button', {name: 'Cancel job …'}).count(), 0);
  noTroubles();
});

test('jobs are listed, and a plan is gone on from', async () => {
  await submitSmallPlan('to go on from');
  await state('done').waitFor();
  const id = decodeURIComponent(page.url().split('/').at(-1));
  await page.getByRole('link', {name: 'Jobs', exact: true}).click();
  const row = page.locator('table.jobs tr', {hasText: id});
  await row.getByText('done').waitFor();
  await row.getByRole('link').click();
  await page.getByRole('link', {name: 'Evaluate it'}).click();
  // The click returns before the page has followed the link.
  await until(async () => await page.getByLabel('On the plan of job').inputValue() === id, 'the plan of the job is filled in');
  assert.ok(await page.getByRole('radio', {name: /Evaluate/}).isChecked());
  // Part and numbers of the plan are still there.
  await submit();
  await page.waitForURL((address) => address.hash.startsWith('#/jobs/') && !address.hash.includes(id));
  await page.getByRole('heading', {name: /Evaluate/}).waitFor();
  if (mock) {
    assert.equal(mock.posts.at(-1).task.plan_job_id, id);
    assert.equal(mock.posts.at(-1).task.plan_options, undefined);
  }
  await page.goto(`${url}#/jobs/unknown`);
  await page.getByText('There is no such job').waitFor();
  noTroubles();
});

test('an inspection.json is loaded with its files', async () => {
  await open();
  const inspection = {
    name: 'loaded', part: {file: '../parts/block.glb'},
    camera: {sensor_file: '../catalogue/camera.json'}, rig: {scan_step_m: 0.002}, goal: {max_scans: 1},
  };
  await page.locator('#file-input').setInputFiles([
    {name: 'inspection.json', mimeType: 'application/json', buffer: Buffer.from(JSON.stringify(inspection))},
    {name: 'block.glb', mimeType: 'model/gltf-binary', buffer: tetrahedronGlb()},
  ]);
  await page.locator('.files .missing', {hasText: 'catalogue/camera.json'}).waitFor();
  await page.locator('.facts', {hasText: '20 × 40 × 60 mm'}).waitFor();
  assert.equal(await field('Scan step').inputValue(), '2');
  await submit();
  await page.locator('.summary', {hasText: 'catalogue/camera.json'}).waitFor();
  if (mock) {
    await choose('camera.json', Buffer.from('{"name": "a camera", "sensor_type": "mono"}'));
    await page.locator('.files', {hasText: 'camera.json'}).waitFor();
    await submit();
    await page.waitForURL(/#\/jobs\/.+/);
    const {task, files} = mock.posts.at(-1);
    assert.deepEqual(files.sort(), ['catalogue/camera.json', 'parts/block.glb']);
    assert.equal(task.inspection.part.file, 'parts/block.glb');
    assert.equal(task.inspection.camera.sensor_file, 'catalogue/camera.json');
  }
  noTroubles();
});

test('measured points are judged', needsMock, async () => {
  await submitSmallPlan('to be measured');
  await state('done').waitFor();
  const plan = decodeURIComponent(page.url().split('/').at(-1));
  await open();
  await page.getByRole('radio', {name: /Inspect/}).check();
  const inspection = {name: 'judged', part: {file: 'block.glb'}, uncertainty: {}, tolerances: {zone_width_m: 1e-4}};
  await page.locator('#file-input').setInputFiles([
    {name: 'inspection.json', mimeType: 'application/json', buffer: Buffer.from(JSON.stringify(inspection))},
    {name: 'block.glb', mimeType: 'model/gltf-binary', buffer: tetrahedronGlb()},
  ]);
  await page.getByLabel('On the plan of job').fill(plan);
  await submit();
  await page.locator('.summary', {hasText: 'Choose the measured points'}).waitFor();
  await page.locator('#file-input').setInputFiles([
    {name: 'scan_02.png', mimeType: 'image/png', buffer: Buffer.from('not looked at')},
    {name: 'scan_01.ply', mimeType: 'text/plain', buffer: tetrahedronPly()},
  ]);
  await page.locator('.files .missing', {hasText: 'scan_02.json'}).waitFor();
  await choose('scan_02.json', Buffer.from('{"column_pitch_m": 1e-4}'));
  await field('Farthest from the part').fill('3');
  await submit();
  await page.waitForURL(/#\/jobs\/.+/);
  const {task, files} = mock.posts.at(-1);
  assert.deepEqual(files.sort(), ['block.glb', 'scan_01.ply', 'scan_02.json', 'scan_02.png']);
  assert.deepEqual(task.inspect_options,
      {measured: [{file: 'scan_01.ply'}, {file: 'scan_02.png'}], tolerated_distance_m: 0.003});
  assert.equal(task.plan_job_id, plan);
  noTroubles();
});

test('recordings are verified', needsMock, async () => {
  await open();
  await page.getByRole('radio', {name: /Verify/}).check();
  const recordings = {format: 'laser-line-recordings', format_version: 1, set: 's', recordings: [{file: 'images/000.png', kind: 'laser'}]};
  await choose('recordings.json', Buffer.from(JSON.stringify(recordings)));
  await page.locator('.files .missing', {hasText: 'images/000.png'}).waitFor();
  await choose('000.png', Buffer.from('not looked at'));
  await submit();
  await page.waitForURL(/#\/jobs\/.+/);
  assert.deepEqual(mock.posts.at(-1).files, ['images/000.png']);
  assert.deepEqual(mock.posts.at(-1).task, {kind: 'verify', recordings});
  // An inspection that another kind left behind is not what a diagnosis compares with.
  await page.getByRole('link', {name: 'New job'}).click();
  await page.getByRole('radio', {name: /Plan/}).check();
  await field('Scan step').fill('2');
  await page.getByRole('radio', {name: /Diagnose/}).check();
  await submit();
  await page.getByRole('heading', {name: /Diagnose/}).waitFor();
  assert.deepEqual(mock.posts.at(-1).task, {kind: 'diagnose', recordings});
  noTroubles();
});

test('meshes of all formats are read', async () => {
  await open();
  for (const [name, bytes] of [['part.obj', tetrahedronObj()], ['part.ply', tetrahedronPly()]]) {
    await choose(name, bytes);
    await page.locator('.units label', {hasText: '10 × 20 × 30 mm'}).click();
    await page.locator('.facts', {hasText: '10 × 20 × 30 mm'}).waitFor();
    await page.locator('.facts', {hasText: '4 triangles'}).waitFor();
  }
  await choose('broken.ply', Buffer.from('not a mesh'));
  await page.locator('.stage-note', {hasText: 'cannot be shown'}).waitFor();
  noTroubles();
});

test('a STEP file without a unit is asked for it', async () => {
  await open();
  await choose('part.step', Buffer.from(
      "ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n#1=PRODUCT('part','part','',());\nENDSEC;\nEND-ISO-10303-21;\n"));
  assert.ok(await page.locator('.units').isHidden());
  await submit();
  await page.locator('.summary .error').waitFor();
  await page.locator('.units label').filter({has: page.locator('input[value="mm"]')}).click();
  await submit();
  await page.waitForURL(/#\/jobs\/.+/);
  if (mock) assert.deepEqual(mock.posts.at(-1).task.inspection.part, {file: 'part.step', unit: 'mm'});
  noTroubles();
});

test('a drop on the stage is taken', async () => {
  await open();
  const transfer = await page.evaluateHandle((base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const data = new DataTransfer();
    data.items.add(new File([bytes], 'dropped.stl'));
    return data;
  }, blockStl().toString('base64'));
  await page.dispatchEvent('.stage', 'drop', {dataTransfer: transfer});
  await page.locator('.files', {hasText: 'dropped.stl'}).waitFor();
  await page.locator('.units label', {hasText: '120 × 80 × 40 mm'}).waitFor();
  noTroubles();
});

test('a lost answer does not make a second job', needsMock, async () => {
  await open();
  await chooseBlock();
  const count = mock.jobs.length, sent = mock.posts.length;
  mock.settings.loseAnswers = Infinity;
  await submit();
  await page.locator('.summary', {hasText: 'does not make a second job'}).waitFor();
  mock.settings.loseAnswers = 0;
  await submit();
  await page.waitForURL(/#\/jobs\/.+/);
  assert.equal(mock.jobs.length, count + 1);
  assert.ok(mock.posts.length - sent >= 4);
  assert.equal(new Set(mock.posts.slice(sent).map(({key}) => key)).size, 1);
  // The same once more is a new job.
  await page.getByRole('link', {name: 'New job'}).click();
  await submit();
  await page.waitForURL((address) => address.hash.startsWith('#/jobs/'));
  assert.equal(mock.jobs.length, count + 2);
  noTroubles();
});

test('a failed job says why', needsMock, async () => {
  await open();
  await choose('broken.stl', Buffer.from('solid'));
  await page.locator('.units label', {hasText: 'mm'}).first().click();
  await submit();
  await state('failed').waitFor();
  await page.getByText('broken.stl: not a mesh').waitFor();
  await shot('job_failed');
  noTroubles();
});

test('a token is asked for, kept and used for results', needsMock, async () => {
  await submitSmallPlan('with a token');
  await state('done').waitFor();
  mock.settings.token = 'right';
  await page.getByRole('link', {name: 'Jobs', exact: true}).click();
  const dialog = page.getByRole('dialog');
  await dialog.getByLabel('Token').fill('wrong');
  await dialog.getByRole('button', {name: 'Use it'}).click();
  await dialog.getByText('does not know this token').waitFor();
  await shot('token');
  await dialog.getByLabel('Token').fill('right');
  await page.keyboard.press('Enter');
  await page.locator('table.jobs tbody tr').first().getByRole('link').click();
  await state('done').waitFor();
  const opened = context.waitForEvent('page');
  await page.getByRole('link', {name: 'Open the report'}).click();
  const report = await opened;
  await report.getByRole('heading', {name: /Report of/}).waitFor();
  await report.close();
  const download = page.waitForEvent('download');
  await page.getByRole('link', {name: 'points/scan_01.ply'}).click();
  assert.equal((await download).suggestedFilename(), 'scan_01.ply');
  await page.reload();
  await state('done').waitFor();
  await page.getByRole('button', {name: 'Forget token'}).click();
  assert.equal(await page.evaluate(() => sessionStorage.length), 0);
  noTroubles();
});

test('long lists have pages', needsMock, async () => {
  const template = mock.jobs[0];
  for (let i = 0; i < 30; ++i) {
    mock.jobs.push({...template, shown: {...template.shown, job_id: `old-${String(i).padStart(2, '0')}`, state: 'SUCCEEDED'}, timer: undefined});
  }
  await open('#/jobs');
  await page.locator('table.jobs tbody tr').nth(24).waitFor();
  await shot('jobs');
  await page.getByRole('button', {name: 'Older'}).click();
  await page.getByText('old-29').waitFor();
  await page.getByRole('button', {name: 'Newer'}).click();
  await page.getByText('Page 1').waitFor();
  await page.getByLabel('State').selectOption('failed');
  // The list of all states may show that job too, until the answer comes.
  await page.locator('table.jobs tbody tr').nth(1).waitFor({state: 'detached'});
  await page.locator('table.jobs tbody tr', {hasText: 'broken.stl'}).waitFor();
  assert.equal(await page.locator('table.jobs tbody tr').count(), 1);
  noTroubles();
});

test('it works by keyboard alone', async () => {
  await open();
  await choose('block.stl', blockStl());
  await page.locator('.units label').first().waitFor();
  await page.locator('h1').focus();
  const reached = new Set();
  for (let i = 0; i < 60; ++i) {
    await page.keyboard.press('Tab');
    const name = await page.evaluate(() => {
      const element = document.activeElement;
      const style = getComputedStyle(element.type === 'radio' && element.name === 'kind' ? element.parentElement : element);
      return {name: element.name || element.textContent.trim(), outline: style.outlineStyle};
    });
    if (name.name) assert.notEqual(name.outline, 'none', `${name.name} shows that it has the focus`);
    reached.add(name.name);
    if (name.name === 'unit') await page.keyboard.press('ArrowDown');
    if (name.name === 'Submit job') break;
  }
  for (const name of ['kind', 'Choose files …', 'unit', 'inspection.camera.columns_px', 'inspection.goal.max_scans', 'Submit job']) {
    assert.ok(reached.has(name), `${name} is reached`);
  }
  noTroubles();
});

for (const [device, viewport] of [['desktop', {width: 1320, height: 900}], ['phone', {width: 390, height: 844}]]) {
  for (const colorScheme of ['light', 'dark']) {
    test(`${device}, ${colorScheme}: nothing sticks out, and accessibility rules hold`, async () => {
      await page.setViewportSize(viewport);
      await page.emulateMedia({colorScheme});
      const check = async (name) => {
        const width = await page.evaluate(() => document.documentElement.scrollWidth);
        assert.ok(width <= viewport.width, `${name} is ${width} px wide`);
        await page.evaluate(readFileSync(axePath, 'utf8'));
        const {violations} = await page.evaluate(() => globalThis.axe.run());
        assert.deepEqual(violations.map(({id, nodes}) => `${name}: ${id}: ${nodes.map(({html}) => html).join(' ')}`), []);
        await shot(`${name}_${device}_${colorScheme}`);
      };
      await open();
      await page.getByRole('heading', {name: 'New job'}).waitFor();
      await check('empty');
      await chooseBlock();
      for (const summary of await page.locator('summary:visible').all()) await summary.click();
      await field('Pixel size').fill('3.45');
      await field('Focal length').fill('16');
      await page.locator('.facts', {hasText: '120 × 80 × 40 mm'}).waitFor();
      await check('filled');
      await open('#/jobs');
      await page.locator('table.jobs tbody tr').first().waitFor();
      await check('list');
      await page.locator('table.jobs tbody tr').first().getByRole('link').click();
      await page.locator('.job-state').waitFor();
      await check('job');
      noTroubles();
    });
  }
}
