// SPDX-License-Identifier: Apache-2.0
// Tables that sort by a column and copy as text.
import {element} from './elements';
import {thumbnail} from './pictures';
import {Cell, Column, numberOf, Row, Table} from './report_data';
import {hasScene} from './scene';

// Smaller tables are read at a glance.
const FEWEST_ROWS_TO_SORT = 4;
const MOST_COLUMNS_AT_EASE = 8;

const isWords = (column: Column): boolean => (column.kind ?? 'TEXT') !== 'NUMBER';

const stateOf = (state: string | undefined): string => (state ?? '').replace('REPORT_STATE_', '').toLowerCase();

function cellElement(cell: Cell, column: Column): HTMLElement {
  const css = [column.kind === 'SHARE' ? 'words of-share' : isWords(column) ? 'words' : '', stateOf(cell.state)];
  const made = element('td', {class: css.filter(Boolean).join(' ') || undefined});
  if (cell.picture?.png) made.append(thumbnail(cell.picture));
  if (column.kind === 'SHARE' && cell.number !== undefined) {
    const share = Math.min(1, Math.max(0, numberOf(cell.number) || 0));
    made.append(element('span', {'class': 'share', 'style': `--share: ${share}`, 'aria-hidden': 'true'}));
  }
  const text = cell.text ?? '';
  if (cell.reason) made.append(element('span', {'class': 'swatch', 'style': `background: var(--reason-${cell.reason})`, 'aria-hidden': 'true'}));
  if (text !== '') made.append(cell.strong ? element('strong', {}, text) : element('span', {class: 'value'}, text));
  if (cell.detail) made.append(element('span', {class: 'detail'}, cell.detail));
  return made;
}

/** Sorts numbers by size, texts as people do; cells without a number come last either way. */
function compare(a: Cell, b: Cell, column: Column): number {
  if (column.kind === 'NUMBER' || column.kind === 'SHARE') {
    const [x, y] = [a, b].map((cell) => (cell.number === undefined ? NaN : numberOf(cell.number)));
    if (!Number.isNaN(x) && !Number.isNaN(y)) return x - y;
    if (!Number.isNaN(x) || !Number.isNaN(y)) return NaN;
  }
  return (a.text ?? '').localeCompare(b.text ?? '', 'en', {numeric: true});
}

const cellOf = (row: Row, index: number): Cell => row.cells?.[index] ?? {};

function sorted(rows: Row[], index: number, column: Column, downwards: boolean): Row[] {
  const hasNumber = (row: Row): boolean => cellOf(row, index).number !== undefined;
  return [...rows].sort((a, b) => {
    const order = compare(cellOf(a, index), cellOf(b, index), column);
    if (Number.isNaN(order)) return hasNumber(a) ? -1 : 1;
    return downwards ? -order : order;
  });
}

/** Unit of a column: its own, or the one that all of its cells share. */
function commonUnit(column: Column, cells: Cell[]): string {
  if (column.unit) return column.unit;
  const units = new Set(cells.filter((cell) => cell.number !== undefined).map((cell) => cell.unit ?? ''));
  return units.size === 1 ? [...units][0] : '';
}

/** Tab-separated lines for spreadsheets, numbers in full. */
export function tableAsText(table: Table, rows: Row[]): string {
  const columns = table.columns ?? [];
  const units = columns.map((column, i) => commonUnit(column, rows.map((row) => cellOf(row, i))));
  const plain = (text: string): string => text.replace(/[\t\n\r]+/g, ' ').trim();
  const head = columns.map((column, i) => plain(
      [column.group, column.name, units[i] ? `[${units[i]}]` : ''].filter(Boolean).join(' ')));
  const lines = rows.map((row) => columns.map((_, i) => {
    const cell = cellOf(row, i);
    if (cell.number === undefined) return plain([cell.text, cell.detail].filter(Boolean).join(' '));
    const other = cell.unit && cell.unit !== units[i] ? ` ${cell.unit}` : '';
    return `${numberOf(cell.number)}${other}`;
  }));
  return [head, ...lines].map((line) => line.join('\t')).join('\n') + '\n';
}

/** The clipboard, or a selection where a sandbox does not give it. */
async function copyText(text: string): Promise<boolean> {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const area = element('textarea', {'aria-hidden': 'true'});
    area.value = text;
    document.body.append(area);
    area.select();
    const copied = document.execCommand('copy');
    area.remove();
    return copied;
  }
}

function groupRow(columns: Column[]): HTMLElement | null {
  if (!columns.some((column) => column.group)) return null;
  const row = element('tr', {class: 'groups'});
  for (let i = 0; i < columns.length;) {
    const group = columns[i].group ?? '';
    let end = i + 1;
    while (end < columns.length && (columns[end].group ?? '') === group) ++end;
    row.append(group ? element('th', {scope: 'colgroup', colspan: String(end - i)}, group) :
      element('td', {colspan: String(end - i)}));
    i = end;
  }
  return row;
}

const columnText = (column: Column): (HTMLElement | string)[] =>
  [column.name ?? '', ...(column.unit ? [element('span', {class: 'unit'}, column.unit)] : [])];

/** A row that steers the view in three dimensions can be reached and pressed by keys. */
function rowElement(row: Row, columns: Column[]): HTMLElement {
  const steers = row.view && hasScene();
  const css = [stateOf(row.state), steers ? 'selectable' : ''].filter(Boolean).join(' ');
  const made = element('tr', {class: css || undefined, tabindex: steers ? '0' : undefined},
      ...columns.map((column, i) => cellElement(cellOf(row, i), column)));
  if (row.view?.scan !== undefined) made.dataset.scan = String(row.view.scan + 1);
  if (row.view?.unmeasured_region !== undefined) made.dataset.region = String(row.view.unmeasured_region);
  if (row.view?.feature !== undefined) made.dataset.feature = String(row.view.feature);
  return made;
}

export function tableElement(table: Table): HTMLElement {
  const columns = table.columns ?? [], all = table.rows ?? [];
  const sortable = all.length >= FEWEST_ROWS_TO_SORT;
  let rows = all, sortedBy = -1, downwards = false;
  const body = element('tbody');
  const heads: HTMLElement[] = [];

  const elements = new Map(all.map((row) => [row, rowElement(row, columns)]));
  const fill = (): void => body.replaceChildren(...rows.map((row) => elements.get(row) as HTMLElement));
  const sortBy = (index: number): void => {
    // Numbers start with the largest; a third press brings the given order back.
    const first = !isWords(columns[index]);
    if (sortedBy !== index) [sortedBy, downwards] = [index, first];
    else if (downwards === first) downwards = !first;
    else sortedBy = -1;
    rows = sortedBy < 0 ? all : sorted(all, index, columns[index], downwards);
    heads.forEach((head, i) => {
      if (i === sortedBy) head.setAttribute('aria-sort', downwards ? 'descending' : 'ascending');
      else head.removeAttribute('aria-sort');
    });
    fill();
  };
  const headRow = element('tr');
  columns.forEach((column, i) => {
    const words = isWords(column) ? 'words' : undefined;
    const head = column.name ?
      element('th', {scope: 'col', class: words, title: column.help}) : element('td', {class: words});
    if (column.name && sortable) {
      const button = element('button', {type: 'button', class: 'sort'}, ...columnText(column));
      button.addEventListener('click', () => sortBy(i));
      head.append(button);
    } else {
      head.append(...columnText(column));
    }
    heads.push(head);
    headRow.append(head);
  });
  fill();
  // Without a heading there is nothing to see above the rows.
  const hasHead = columns.some((column) => column.name);
  const name = table.title || columns.find((column) => column.name)?.name || 'Table';
  const wrap = element('div', {'class': 'table-wrap', 'tabindex': '0', 'role': 'group', 'aria-label': name},
      element('table', {class: columns.length > MOST_COLUMNS_AT_EASE ? 'dense' : undefined}, hasHead ? element('thead', {}, groupRow(columns), headRow) : null, body));
  const whole = element('div', {class: 'table'}, wrap);
  if (sortable) {
    const button = element('button', {'type': 'button', 'class': 'copy', 'aria-label': `Copy table: ${name}`}, 'Copy');
    button.addEventListener('click', async () => {
      button.textContent = await copyText(tableAsText(table, rows)) ? 'Copied' : 'Not copied';
      setTimeout(() => { button.textContent = 'Copy'; }, 2000);
    });
    whole.append(button);
  }
  return whole;
}
