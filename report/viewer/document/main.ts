// SPDX-License-Identifier: Apache-2.0
// Shows the report that stands in the page as JSON.
import {blockElement, factElements, runElements} from './blocks';
import {element} from './elements';
import {readReport, Report, Section} from './report_data';
import {showScene} from './scene';

function headElement(report: Report): HTMLElement {
  const head = element('header', {class: 'page-head'});
  if (report.subject) head.append(element('p', {class: 'kicker'}, report.subject));
  head.append(element('h1', {}, report.heading || report.title || 'Report'));
  if (report.finding?.length) head.append(element('p', {class: 'finding'}, ...runElements(report.finding)));
  if (report.figures?.length) {
    head.append(element('dl', {class: 'figures'},
        ...report.figures.map((fact) => element('div', {}, ...factElements(fact)))));
  }
  if (report.warnings?.length) {
    head.append(element('div', {class: 'notice warnings'}, element('h2', {}, 'Please note'),
        element('ul', {}, ...report.warnings.map((warning) => element('li', {}, warning)))));
  }
  return head;
}

function sectionElement(section: Section): HTMLElement {
  return element('section', {id: section.id || undefined, class: section.new_page ? 'new-page' : undefined},
      element('h2', {}, section.title ?? ''), ...(section.blocks ?? []).map((block) => blockElement(block)));
}

/** Neighbouring narrow sections stand side by side. */
function sectionElements(sections: Section[]): HTMLElement[] {
  const made: HTMLElement[] = [];
  let beside: HTMLElement | null = null;
  for (const section of sections) {
    if (!section.narrow) {
      beside = null;
      made.push(sectionElement(section));
      continue;
    }
    if (!beside) made.push(beside = element('div', {class: 'narrow-sections'}));
    beside.append(sectionElement(section));
  }
  return made;
}

/** Folded parts are printed, too. A browser repeats the head of a table on every page only without buttons in it. */
function prepareForPrint(): void {
  let opened: HTMLDetailsElement[] = [];
  let sortedHeads: { head: HTMLElement; button: HTMLElement }[] = [];
  window.addEventListener('beforeprint', () => {
    opened = [...document.querySelectorAll('details')].filter((part) => !part.open && !part.classList.contains('values'));
    for (const part of opened) part.open = true;
    sortedHeads = [...document.querySelectorAll<HTMLElement>('th > button.sort')].map((button) =>
      ({head: button.parentElement as HTMLElement, button}));
    for (const {head, button} of sortedHeads) head.replaceChildren(...button.childNodes);
  });
  window.addEventListener('afterprint', () => {
    for (const part of opened) part.open = false;
    for (const {head, button} of sortedHeads) {
      button.replaceChildren(...head.childNodes);
      head.append(button);
    }
    sortedHeads = [];
  });
}

function show(): void {
  const page = document.getElementById('report');
  const data = document.getElementById('report-data');
  if (!page) return;
  try {
    const report = readReport(data?.textContent ?? '');
    // Sheets to take to the machine are printed otherwise.
    document.body.dataset.kind = report.kind ?? '';
    page.replaceChildren(headElement(report), element('main', {}, ...sectionElements(report.sections ?? [])),
        element('footer', {}, 'Sightline. One file, nothing is loaded from anywhere; its data are also in a JSON file beside it.'));
    showScene();
  } catch (error) {
    const reason = error instanceof Error ? error.message : String(error);
    page.replaceChildren(element('main', {}, element('h1', {}, 'This report is damaged'),
        element('p', {class: 'notice'}, `Its data cannot be read: ${reason}. The command that wrote it can write it again.`)));
  }
}

show();
prepareForPrint();
