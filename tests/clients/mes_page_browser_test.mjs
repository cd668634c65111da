// SPDX-License-Identifier: Apache-2.0
// mes_page_browser_test.mjs PACKAGES: the page of the simulated MES of examples/factory in headless
// Chromium. PACKAGES has node_modules with playwright-core. Exit code 77: there is no Chromium (CHROMIUM
// names it).
import assert from 'node:assert/strict';
import {existsSync, mkdtempSync, rmSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import {join, resolve} from 'node:path';
import {pathToFileURL} from 'node:url';
import {mesPage} from '../../examples/factory/mes_page.mjs';

const executablePath = process.env.CHROMIUM || '/usr/bin/chromium';
if (!existsSync(executablePath)) {
  console.log(`SKIPPED: there is no Chromium at ${executablePath} (apt-get install chromium, or set CHROMIUM)`);
  process.exit(77);
}
const {chromium} = createRequire(join(resolve(process.argv[2]), 'package.json'))('playwright-core');
const HOSTILE = '<script>document.title = "broken"</script>"&';
const measurement = {camera_distance_m: 0.2, triangulation_angle_deg: 30, camera_azimuth_deg: 0, camera_polar_deg: 12.34, part_gamma_deg: -7};
const events = ['RecipePrepared', 'JobStarted', 'ResultReady', 'Ready'].map((type, i) =>
  ({type: `${type}EventType`, message: i === 2 ? HOSTILE : type, time: `2026-01-01T00:00:0${i}Z`}));
const page_text = mesPage({order: {job_id: HOSTILE, events}, saved: ['report.html', 'plan.json'],
  plan: {inspection_name: HOSTILE, coverage: {coverage: 0.957}, scans: [{measurement}, {measurement}]}});

const folder = mkdtempSync(join(tmpdir(), 'mes-page-'));
writeFileSync(join(folder, 'index.html'), page_text);
writeFileSync(join(folder, 'plan.json'), '{}');
const browser = await chromium.launch({executablePath, headless: true, args: ['--no-sandbox', '--disable-gpu']});
try {
  for (const width of [1200, 390]) {
    const page = await browser.newPage({viewport: {width, height: 800}});
    await page.goto(pathToFileURL(join(folder, 'index.html')).href);
    assert.equal(await page.title(), `Order ${HOSTILE}`);
    assert.equal(await page.locator('h1').innerText(), `Order ${HOSTILE}`);
    assert.match(await page.locator('.done').innerText(), /has 2 scans, which see 95\.7 % of the surface/);
    const rows = page.locator('tbody tr');
    assert.equal(await rows.count(), events.length + 2);
    assert.match(await rows.nth(2).innerText(), /ResultReady\s+<script>/);
    assert.match(await rows.last().innerText(), /2\s+200\.0\s+30\.0\s+0\.0\s+12\.3\s+0\.0\s+0\.0\s+-7\.0/);
    assert.ok(await page.evaluate(() => document.documentElement.scrollWidth) <= width, `wider than ${width} px`);
    await page.getByRole('link', {name: 'plan.json'}).click();
    assert.match(page.url(), /plan\.json$/);
    await page.close();
  }
  console.log('the page of the order is as expected');
} finally {
  await browser.close();
  rmSync(folder, {recursive: true, force: true});
}
