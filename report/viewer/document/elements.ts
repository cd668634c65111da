// SPDX-License-Identifier: Apache-2.0
// Elements of the page. Texts become text nodes, never markup.

type Child = Node | string | null | undefined;

/** <tag attribute="value">children</tag>; attributes without a value are left out. */
export function element<K extends keyof HTMLElementTagNameMap>(
    tag: K, attributes: Record<string, string | undefined> = {}, ...children: Child[]): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value !== undefined) made.setAttribute(name, value);
  }
  for (const child of children) {
    if (child !== null && child !== undefined && child !== '') made.append(child);
  }
  return made;
}

/** The same for drawings. */
export function drawn<K extends keyof SVGElementTagNameMap>(
    tag: K, attributes: Record<string, string | number>, text?: string): SVGElementTagNameMap[K] {
  const made = document.createElementNS('http://www.w3.org/2000/svg', tag);
  for (const [name, value] of Object.entries(attributes)) {
    made.setAttribute(name, typeof value === 'number' ? String(Math.round(value * 10) / 10) : value);
  }
  if (text !== undefined) made.textContent = text;
  return made;
}
