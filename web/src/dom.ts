// SPDX-License-Identifier: Apache-2.0
// Elements of the page: those of index.html, and new ones.

export const get = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;

/** Changes a text where it differs: what is the same is not laid out anew. */
export function write(box: Element, text: string): void {
  if (box.textContent !== text) box.textContent = text;
}

export function element<Tag extends keyof HTMLElementTagNameMap>(
  tag: Tag,
  properties: Partial<HTMLElementTagNameMap[Tag]> = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[Tag] {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}
