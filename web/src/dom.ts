// SPDX-License-Identifier: Apache-2.0
// Elements of the page: those of index.html, and new ones.

export const get = <T extends HTMLElement>(id: string): T => document.getElementById(id) as T;

/** Changes the text of `at`, by its id, where it differs: the same is not laid out anew. */
export function write(at: string | Element, text: string): void {
  const box = typeof at === "string" ? get(at) : at;
  if (box.textContent !== text) box.textContent = text;
}

/** The same of a part that is there only while there is something to be said. */
export function say(id: string, text: string): void {
  write(id, text);
  get(id).hidden = !text;
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
