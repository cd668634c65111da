// SPDX-License-Identifier: Apache-2.0
// Elements of the blocks of a report.
import {chartElement} from './charts/chart';
import {chartKey} from './charts/chart_key';
import {element} from './elements';
import {drawingElement} from './drawing';
import {pictureElement} from './pictures';
import {Block, Chart, Fact, Group, Paragraph, Run, ValueMap} from './report_data';
import {sceneElement} from './scene';
import {tableElement} from './table';
import {mapElement, mapKey} from './charts/value_map';

// Links lead to files beside the report. A scheme could run a script.
const SAFE_LINK = /^[A-Za-z0-9_][A-Za-z0-9_./-]*$|^#[A-Za-z0-9_-]+$/;

export function runElements(runs: Run[] | undefined): (Node | string)[] {
  return (runs ?? []).map((run) => {
    const text = run.text ?? '';
    if (run.link && SAFE_LINK.test(run.link)) return element('a', {href: run.link}, text);
    if (run.code) return element('code', {}, text);
    return run.strong ? element('strong', {}, text) : text;
  });
}

const paragraphElement = (paragraph: Paragraph): HTMLElement =>
  element('p', {class: paragraph.remark ? 'soft' : undefined}, ...runElements(paragraph.runs));

export function factElements(fact: Fact): [HTMLElement, HTMLElement] {
  return [element('dt', {}, fact.name ?? ''),
    element('dd', {}, fact.text ?? '', fact.detail ? element('small', {}, ` ${fact.detail}`) : null)];
}

/** Charts and maps of a block and of the groups in it. */
function within<T>(blocks: Block[], of: (block: Block) => T | undefined): T[] {
  return blocks.flatMap((block) => {
    const found = of(block);
    return found === undefined ? within(block.group?.blocks ?? [], of) : [found];
  });
}
const chartsIn = (blocks: Block[]): Chart[] => within(blocks, (block) => block.chart);
const mapsIn = (blocks: Block[]): ValueMap[] => within(blocks, (block) => block.map);

function groupElement(group: Group, keyIsAbove: boolean): HTMLElement {
  const blocks = group.blocks ?? [];
  const charts = chartsIn(blocks), maps = mapsIn(blocks);
  // The outermost group of several charts has their common key; those in it have none.
  const hasKey = !keyIsAbove && charts.length + maps.length > 1;
  const keys = hasKey ? [chartKey(charts), maps.length > 0 ? mapKey(maps[0]) : null] : [];
  const body = blocks.map((block) => blockElement(block, keyIsAbove || hasKey));
  const layouts: Partial<Record<string, string>> =
    {TWO_COLUMNS: 'cards', THREE_COLUMNS: 'cards three', FOUR_COLUMNS: 'cards four', ROW: 'frames'};
  const css = layouts[group.layout ?? 'STACK'];
  const laid = css ? [element('div', {class: css}, ...body)] : body;
  if (group.folded) {
    return element('details', {}, element('summary', {}, group.title || 'More'), ...keys, ...laid);
  }
  const heading = group.title ? element('h3', {}, group.title) : null;
  const subtitle = group.subtitle ? element('p', {class: 'soft'}, group.subtitle) : null;
  return element('div', {class: group.framed ? 'card' : 'group'}, heading, subtitle, ...keys, ...laid);
}

/** `keyIsAbove`: the key of charts stands above them already. */
export function blockElement(block: Block, keyIsAbove = false): HTMLElement {
  if (block.paragraph) return paragraphElement(block.paragraph);
  if (block.list) {
    return element(block.list.numbered ? 'ol' : 'ul', {}, ...(block.list.items ?? []).map((item) => element('li', {}, ...runElements(item.runs))));
  }
  if (block.facts) return element('dl', {class: 'facts'}, ...(block.facts.facts ?? []).flatMap(factElements));
  if (block.table) return tableElement(block.table);
  if (block.chart) {
    const key = keyIsAbove ? null : chartKey([block.chart]);
    return element('div', {class: 'chart-block'}, key, chartElement(block.chart));
  }
  if (block.map) return element('div', {}, keyIsAbove ? null : mapKey(block.map), mapElement(block.map));
  if (block.picture) return pictureElement(block.picture);
  if (block.scene) return sceneElement(block.scene);
  if (block.drawing) return drawingElement(block.drawing);
  if (block.group) return groupElement(block.group, keyIsAbove);
  if (block.note) return element('p', {class: 'notice'}, block.note.text ?? '');
  return element('p', {class: 'notice'}, 'This page is older than its report: it cannot show what stands here. See report.json.');
}
