// SPDX-License-Identifier: Apache-2.0
// validate.mjs FOLDER FILE...: checks files with validators from npm, which FOLDER/node_modules has.
//
// By the end of the name: .glb with Khronos's glTF validator, .openapi.json with the schema of OpenAPI,
// .html with html-validate (what scripts make of a report, too) and, in Chromium at two widths, with
// axe-core. Prints a line for every problem. Exit codes: 0 none, 1 there are some, 77 there is no Chromium (CHROMIUM names it).
import {existsSync, readFileSync} from 'node:fs';
import {createRequire} from 'node:module';
import {basename, join, resolve} from 'node:path';
import {pathToFileURL} from 'node:url';

const [folder, ...files] = process.argv.slice(2);
const require = createRequire(join(resolve(folder), 'package.json'));
// Packages of ES modules alone cannot be required.
const load = (name, main) => import(pathToFileURL(join(resolve(folder), 'node_modules', name, main)).href);
let problems = 0;
function report(file, text) {
  ++problems;
  console.log(`${basename(file)}: ${text}`);
}
const named = (end) => files.filter((file) => file.endsWith(end));

for (const file of named('.glb')) {
  const {issues} = await require('gltf-validator').validateBytes(new Uint8Array(readFileSync(file)), {maxIssues: 0});
  for (const issue of issues.messages) {
    if (issue.severity <= 1) report(file, `${issue.pointer}: ${issue.message}`);
  }
}

for (const file of named('.openapi.json')) {
  const {Validator} = await load('@seriousme/openapi-schema-validator', 'index.js');
  const {valid, errors} = await new Validator().validate(JSON.parse(readFileSync(file, 'utf8')));
  if (!valid) report(file, JSON.stringify(errors));
}

// Colours and widths of charts are computed, so that they stand in style attributes.
const rules = {'no-inline-style': 'off'};
// A browser writes hidden as hidden="".
const rulesOfBrowser = {...rules, 'attribute-boolean-style': 'off'};
if (named('.html').length > 0) {
  const {HtmlValidate} = require('html-validate');
  const validateMarkup = async (file, what, html, used = rules) => {
    const {results} = await new HtmlValidate({root: true, extends: ['html-validate:recommended'], rules: used}).validateString(html);
    for (const {messages} of results) {
      for (const found of messages) report(file, `${what}line ${found.line}: ${found.ruleId}: ${found.message}`);
    }
  };
  for (const file of named('.html')) await validateMarkup(file, '', readFileSync(file, 'utf8'));
  const executablePath = process.env.CHROMIUM || '/usr/bin/chromium';
  if (!existsSync(executablePath)) {
    console.log(`SKIPPED: axe-core needs Chromium at ${executablePath} (apt-get install chromium, or set CHROMIUM)`);
    process.exit(problems > 0 ? 1 : 77);
  }
  const browser = await require('playwright-core').chromium.launch({
    executablePath, headless: true, args: ['--no-sandbox', '--disable-gpu', '--enable-unsafe-swiftshader'],
  });
  for (const file of named('.html')) {
    // On a narrow page tables and charts scroll.
    for (const width of [1280, 480]) {
      const context = await browser.newContext({viewport: {width, height: 800}, bypassCSP: true});
      const page = await context.newPage();
      await page.goto(pathToFileURL(file).href);
      // Charts are drawn once the page has a layout.
      await page.evaluate(() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn))));
      if (await page.locator('#viewer').count() > 0) await page.locator('#viewer:visible').waitFor();
      if (await page.locator('#report-data').count() > 0 && width > 1000) {
        await validateMarkup(file, 'with scripts, ', await page.evaluate(() => '<!DOCTYPE html>\n' + document.documentElement.outerHTML),
            rulesOfBrowser);
      }
      await page.addScriptTag({path: require.resolve('axe-core/axe.min.js')});
      const {violations} = await page.evaluate(() => globalThis.axe.run());
      for (const {id, help, nodes} of violations) {
        report(file, `${width} px: ${id}: ${help}: ${nodes.length} times, first ${nodes[0].html.slice(0, 160)}`);
      }
      await context.close();
    }
  }
  await browser.close();
}
process.exit(problems > 0 ? 1 : 0);
