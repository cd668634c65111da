// SPDX-License-Identifier: Apache-2.0
// report_page_browser_test.mjs WRITTEN_DOCUMENTS PACKAGES: pages of reports in headless Chromium, from the
// samples that the program WRITTEN_DOCUMENTS writes. Exit code 77: there is no Chromium (CHROMIUM names it).
import assert from 'node:assert/strict';
import {execFileSync} from 'node:child_process';
import {existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {tmpdir} from 'node:os';
import {join, resolve} from 'node:path';
import {pathToFileURL} from 'node:url';

const [program, packages] = process.argv.slice(2);
const executablePath = process.env.CHROMIUM || '/usr/bin/chromium';
if (!existsSync(executablePath)) {
  console.log(`SKIPPED: there is no Chromium at ${executablePath} (apt-get install chromium, or set CHROMIUM)`);
  process.exit(77);
}
const {chromium} = createRequire(join(resolve(packages), 'package.json'))('playwright-core');
const folder = mkdtempSync(join(tmpdir(), 'sightline-report-page-'));
execFileSync(program, [folder]);
const REPORTS = ['diagnosis_report', 'optics_report', 'sensor_report', 'verification_report'];
const PLANS = ['plan_report', 'full_plan_report', 'setup'];
const PAGE_TIMEOUT_MS = 120000;
const browser = await chromium.launch({
  executablePath, headless: true, args: ['--no-sandbox', '--disable-gpu', '--enable-unsafe-swiftshader'],
});

/** Opens a page, waits until its charts are drawn, and closes it after `use`. Scripts that fail are an error. */
async function withPage(file, use, options = {}) {
  const context = await browser.newContext({viewport: {width: 1400, height: 900}, ...options});
  const page = await context.newPage();
  // It only ends a test that hangs.
  page.setDefaultTimeout(PAGE_TIMEOUT_MS);
  const errors = [];
  page.on('pageerror', (error) => errors.push(error.message));
  page.on('console', (message) => { if (message.type() === 'error') errors.push(message.text()); });
  await page.goto(pathToFileURL(file).href);
  if (options.javaScriptEnabled !== false) {
    await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
  }
  await use(page);
  assert.deepEqual(errors, [], file);
  await context.close();
}

const pageOf = (name) => join(folder, `${name}.html`);
const template = readFileSync(pageOf('sensor_report'), 'utf8');

/** A page of this report. */
function writePage(name, data) {
  const begin = template.indexOf('id="report-data">') + 'id="report-data">'.length;
  const text = typeof data === 'string' ? data : JSON.stringify(data).replaceAll('<', '\\u003c');
  writeFileSync(pageOf(name), template.slice(0, begin) + text + template.slice(template.indexOf('</script>', begin)));
  return pageOf(name);
}

const tests = {
  'nothing is wider than the page': async () => {
    for (const name of [...REPORTS, ...PLANS]) {
      for (const width of [1400, 800, 390]) {
        await withPage(pageOf(name), async (page) => {
          const wide = await page.evaluate(() => document.documentElement.scrollWidth);
          assert.ok(wide <= width, `${name} at ${width} px is ${wide} px wide`);
        }, {viewport: {width, height: 900}});
      }
    }
  },

  'every dot lies inside of its drawing': async () => {
    for (const name of REPORTS) {
      await withPage(pageOf(name), async (page) => {
        const found = await page.evaluate(() => {
          const outside = [];
          let dots = 0;
          for (const svg of document.querySelectorAll('.chart-stage svg')) {
            const {width, height} = svg.viewBox.baseVal;
            for (const dot of svg.querySelectorAll('circle')) {
              ++dots;
              const [x, y] = [dot.cx.baseVal.value, dot.cy.baseVal.value];
              if (!(x >= 0 && x <= width && y >= 0 && y <= height)) outside.push(svg.getAttribute('aria-label'));
            }
          }
          return {dots, outside};
        });
        assert.deepEqual(found.outside, [], name);
        assert.ok(found.dots > 20, `${name}: ${found.dots} dots`);
      });
    }
  },

  'a damaged report says so': async () => {
    for (const [data, reason] of [['{"heading": "x", "sections": [', 'JSON'], ['[]', 'no JSON object'], ['', 'JSON']]) {
      await withPage(writePage('damaged', data), async (page) => {
        assert.equal(await page.locator('h1').textContent(), 'This report is damaged');
        assert.match(await page.locator('.notice').textContent(), new RegExp(reason));
      });
    }
  },

  'without scripts the page names its data': async () => {
    await withPage(pageOf('sensor_report'), async (page) => {
      assert.match(await page.locator('body').innerText(), /needs JavaScript\. Its data are in the file report\.json/);
    }, {javaScriptEnabled: false});
  },

  'texts are no markup, and links run nothing': async () => {
    const hostile = '</script><img src=x onerror=alert(1)>';
    const report = {
      title: hostile, heading: hostile, warnings: [hostile], finding: [{text: hostile, link: 'javascript:alert(1)'}],
      sections: [{id: 'a', title: hostile, blocks: [
        {paragraph: {runs: [{text: 'a file', link: 'setup.html'}, {text: 'a scheme', link: 'data:text/html,x'}]}},
        {table: {title: hostile, columns: [{name: hostile}], rows: [{cells: [{text: hostile, detail: hostile}]}]}}]}],
    };
    await withPage(writePage('hostile', report), async (page) => {
      assert.equal(await page.locator('img').count(), 0);
      assert.deepEqual(await page.locator('a').evaluateAll((links) => links.map((link) => link.getAttribute('href'))),
          ['setup.html']);
      assert.equal(await page.locator('h1').textContent(), hostile);
    });
  },

  'a block of a later version is named, the rest is shown': async () => {
    const report = {heading: 'x', sections: [{id: 'a', title: 'A', blocks: [{hologram: {}}, {paragraph: {runs: [{text: 'here'}]}}]}]};
    await withPage(writePage('later', report), async (page) => {
      assert.match(await page.locator('#a').innerText(), /older than its report[\s\S]*here/);
    });
  },

  'a plan shows its part, and rows steer the view': async () => {
    await withPage(pageOf('plan_report'), async (page) => {
      await page.locator('#viewer:visible').waitFor();
      assert.match(await page.locator('#legend').innerText(), /admissible/);
      const second = page.locator('#scans tbody tr').nth(1);
      await second.focus();
      await page.keyboard.press('Enter');
      assert.match(await second.getAttribute('class'), /selected/);
      assert.equal(await page.locator('#scan').inputValue(), '2');
      // A row stays chosen where it is sorted to.
      await page.locator('#features tbody tr').first().click();
      assert.equal(await page.locator('#region-chip').isVisible(), true);
      assert.match(await page.locator('#features tbody tr').first().getAttribute('class'), /selected/);
      await page.locator('#region-clear').click();
      assert.equal(await page.locator('#region-chip').isVisible(), false);
    });
  },

  'a scene that cannot be read says so, and the tables stay': async () => {
    const text = readFileSync(pageOf('plan_report'), 'utf8');
    const damaged = text.replace(/"triangles":"[^"]*"/, '"triangles":"AAAA"');
    assert.notEqual(damaged, text);
    writeFileSync(pageOf('damaged_scene'), damaged);
    await withPage(pageOf('damaged_scene'), async (page) => {
      await page.locator('#fallback-notice:visible').waitFor();
      await page.waitForFunction(() => /could not start/.test(document.querySelector('#fallback-notice').textContent));
      assert.equal(await page.locator('#viewer').isVisible(), false);
      assert.ok(await page.locator('#scans tbody tr').count() > 0);
      assert.equal(await page.locator('tr[tabindex]').count(), 0);
    });
  },

  'a picture of a table is enlarged and closed by keys': async () => {
    const png = 'iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5ErkJggg==';
    const report = {heading: 'x', sections: [{id: 'a', title: 'A', blocks: [
      {table: {title: 'Scans', columns: [{name: 'scan'}], rows: [{cells: [{text: '1', picture: {png, alternative: 'Scan 1'}}]}]}}]}]};
    await withPage(writePage('thumbnail', report), async (page) => {
      await page.getByRole('button', {name: 'Enlarge: Scan 1'}).press('Enter');
      assert.equal(await page.locator('dialog img').getAttribute('alt'), 'Scan 1');
      await page.keyboard.press('Escape');
      await page.locator('dialog').waitFor({state: 'detached'});
    });
  },

  'a table of 1000 rows sorts and comes back': async () => {
    const rows = Array.from({length: 1000}, (_, i) => ({cells: [{text: `scan ${i + 1}`},
      i === 500 ? {text: '\u2013'} : {text: String((i * 377) % 1000), number: (i * 377) % 1000}]}));
    const report = {heading: 'x', sections: [{id: 'a', title: 'A', blocks: [
      {table: {title: 'Scans', columns: [{name: 'scan'}, {name: 'new', kind: 'NUMBER'}], rows}}]}]};
    await withPage(writePage('long', report), async (page) => {
      const cells = () => page.locator('tbody tr td:nth-child(2)').allTextContents();
      const given = await cells();
      assert.equal(given.length, 1000);
      await page.getByRole('button', {name: 'new'}).click();
      let values = (await cells()).slice(0, -1).map(Number);
      assert.deepEqual(values, [...values].sort((a, b) => b - a));
      assert.equal((await cells()).at(-1), '\u2013');
      assert.equal(await page.locator('th').nth(1).getAttribute('aria-sort'), 'descending');
      await page.getByRole('button', {name: 'new'}).click();
      values = (await cells()).slice(0, -1).map(Number);
      assert.deepEqual(values, [...values].sort((a, b) => a - b));
      assert.equal((await cells()).at(-1), '\u2013');
      await page.getByRole('button', {name: 'new'}).click();
      assert.deepEqual(await cells(), given);
    });
  },

  'a table copies as text': async () => {
    await withPage(pageOf('optics_report'), async (page) => {
      await page.getByRole('button', {name: 'Copy table: Every f-number in numbers'}).click();
      const text = await page.evaluate(() => navigator.clipboard.readText());
      const lines = text.trim().split('\n').map((line) => line.split('\t'));
      assert.equal(lines.length, 10);
      assert.ok(lines.every((line) => line.length === lines[0].length));
      assert.ok(lines[0].includes('exposure time [s]'), lines[0].join(', '));
      assert.equal(lines[5][1], '0.037632');
    }, {permissions: ['clipboard-read', 'clipboard-write']});
  },

  'a chart shows values on pointing and as a table': async () => {
    await withPage(pageOf('sensor_report'), async (page) => {
      const figure = page.locator('.chart-figure').first();
      await figure.scrollIntoViewIfNeeded();
      await figure.locator('circle').nth(3).hover({force: true});
      assert.match(await figure.locator('.pointed').textContent(), /measured[\s\S]*DN/);
      await figure.locator('summary').click();
      // The page fills the table when it is opened, not in the click itself.
      await figure.locator('.values tbody tr').nth(40).waitFor();
    });
  },
};

let failed = 0;
for (const [name, run] of Object.entries(tests)) {
  try {
    await run();
    console.log(`ok   ${name}`);
  } catch (error) {
    ++failed;
    console.log(`FAIL ${name}\n${error.stack}`);
  }
}
await browser.close();
rmSync(folder, {recursive: true});
process.exit(failed > 0 ? 1 : 0);
