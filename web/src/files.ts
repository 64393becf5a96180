// SPDX-License-Identifier: Apache-2.0
// Files that are dropped onto the page, or chosen, to be touched.

import type { Toast } from "./dispatch";
import { get } from "./dom";
import { mayOperate } from "./panel";
import type { Hello, State } from "./protocol";

/** The name under which a file is sent: letters, digits, '.', '-' and '_', its ending kept. */
export function plainName(name: string): string {
  const plain = name.replace(/[^A-Za-z0-9._-]+/g, "_").replace(/^\.+/, "");
  return plain.slice(-100) || "file";
}

/** Why what was dropped is not sent; null: it is. */
export function whyNotSent(
  files: readonly Pick<File, "name" | "size">[],
  hello: Pick<Hello, "file_limit"> | null,
  state: Pick<State, "role"> | null,
): string | null {
  if (!hello || !state) return "There is no connection to the program.";
  if (!mayOperate(state)) return "Only the operator's page opens files.";
  if (hello.file_limit === 0)
    return "This session opens no files: its device is not the mouse. Use --camera.";
  if (files.length !== 1) return "Drop one file at a time.";
  const megabytes = (bytes: number) => `${Math.ceil(bytes / 1e6)} MB`;
  const { name, size } = files[0]!;
  if (size > hello.file_limit)
    return (
      `${name} is of ${megabytes(size)}, more than ${megabytes(hello.file_limit)}. ` +
      "Start the program with --camera and its path."
    );
  return null;
}

export interface FileActions {
  /** @param name  under which it is sent */
  send(file: File, name: string): void;
  toast: Toast;
  hello(): Hello | null;
  state(): State | null;
}

/** Listens to what is dropped or chosen. */
export function takeFiles(actions: FileActions): void {
  const send = (files: readonly File[]): void => {
    const refusal = whyNotSent(files, actions.hello(), actions.state());
    if (refusal) return actions.toast(refusal);
    actions.send(files[0]!, plainName(files[0]!.name));
  };
  const input = get<HTMLInputElement>("file");
  get("open-file").addEventListener("click", () => input.click());
  input.addEventListener("change", () => {
    if (input.files?.length) send([...input.files]);
    input.value = ""; // the same file may be chosen again
  });
  const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
  const show = (shown: boolean) => (get("drop").hidden = !shown);
  addEventListener("dragover", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    show(true);
  });
  addEventListener("dragleave", (event) => event.relatedTarget === null && show(false));
  addEventListener("drop", (event) => {
    if (!hasFiles(event)) return;
    event.preventDefault();
    show(false);
    const entries = [...event.dataTransfer!.items].map((item) => item.webkitGetAsEntry?.());
    if (entries.some((entry) => entry?.isDirectory))
      actions.toast("A folder cannot be dropped. Start the program with --camera.");
    else send([...event.dataTransfer!.files]);
  });
}
