// SPDX-License-Identifier: Apache-2.0
// Method, parameters, safety and session: what the program says of itself, and what can be set.

import { element, get, say, write } from "./dom";
import type { Command, Hello, ParameterRow, Role, State } from "./protocol";

/** What a page is called, and what it may do. */
export const roleNames: Record<Role, { name: string; may: string }> = {
  looking: {
    name: "looking on",
    may: "For viewing only. Take control of the HIP to move it and to set the method's parameters.",
  },
  holding: {
    name: "hand holder",
    may: "This page has the hand: it sets the method's parameters and makes limits stricter.",
  },
  operating: { name: "operator", may: "This page operates the session: it may change everything." },
};

const OPERATORS_LINK = "the operator's link, which the program printed at its start";

export function mayOperate({ role }: Pick<State, "role">): boolean {
  return role === "operating";
}

/** May a page of this role set a safety limit, at least to a stricter value? */
export function maySetLimit(role: Role, row: Pick<ParameterRow, "stricter">): boolean {
  return role === "operating" || (role === "holding" && Boolean(row.stricter));
}

/** Why something is greyed out, for each part of the panel; empty: nothing is. */
export function whyNot(role: Role): { method: string; safety: string; session: string } {
  if (role === "operating") return { method: "", safety: "", session: "" };
  const [who, parameters, limits] =
    role === "holding"
      ? ["You have the hand", "You may set the parameters", "You may make limits stricter"]
      : [
          "You are looking on",
          "Hold the hand (Space) to set the parameters",
          "Hold the hand (Space) to make limits stricter",
        ];
  return {
    method: `${who}. ${parameters}. For all else, open ${OPERATORS_LINK}.`,
    safety: `${who}. ${limits}. To loosen them, open ${OPERATORS_LINK}.`,
    session: `${who}. To change where the hand is, open ${OPERATORS_LINK}.`,
  };
}

/** A scene's name in the list: of a file or folder, the last part of its path. */
export function sceneName(uri: string): string {
  const [scheme, ...rest] = uri.split(":");
  const name = rest.join(":");
  return scheme === "synthetic" ? name : (/([^/?]+)\/*(\?.*)?$/.exec(name)?.[0] ?? uri);
}

/** What is looked at, whether it goes on, and what of it was left out. */
export function cameraText({ cameras, playback }: Pick<State, "cameras" | "playback">): string {
  const troubled = cameras.find(({ state }) => state !== "live");
  if (troubled) return `${sceneName(troubled.uri)} · ${troubled.state}`;
  const first = cameras[0];
  if (!first) return "no camera";
  const isLast = first.place === first.frames - 1;
  const stays =
    first.frames === 1
      ? "still picture"
      : isLast && !playback?.loop
        ? "ended, its last frame stays"
        : "paused";
  const how = first.stays_valid ? stays : `${first.rate.toFixed(0)} Hz`;
  const dropped = cameras.reduce((sum, camera) => sum + camera.dropped, 0);
  const frames = dropped === 1 ? "frame" : "frames";
  const lost = dropped > 0 ? ` · ${dropped.toLocaleString("en")} ${frames} dropped` : "";
  return `${sceneName(first.uri)} · ${how}${lost}`;
}

/** What is to be said while faults are latched; empty: none is. */
export function latchedText({ role, latched_by }: Pick<State, "role" | "latched_by">): string {
  if (latched_by.length === 0) return "";
  const what = `Faults: ${latched_by.join(", ")}.`;
  return role === "operating"
    ? `${what} Find their cause, let go of the surface, then reset them.`
    : `${what} Only the operator resets them: open ${OPERATORS_LINK}.`;
}

/** What speaks against the present stiffness, as the program has it; empty: nothing does. */
export function warningText(warnings: readonly string[]): string {
  return warnings.map((text) => `${text.charAt(0).toUpperCase()}${text.slice(1)}.`).join(" ");
}

/** How a unit of the table is shown: small lengths in mm, angles in degrees. */
export function shownUnit(row: Pick<ParameterRow, "unit" | "max">): {
  unit: string;
  factor: number;
} {
  if (row.unit === "m" && row.max <= 1) return { unit: "mm", factor: 1e3 };
  if (row.unit === "rad") return { unit: "°", factor: 180 / Math.PI };
  return { unit: row.unit === "-" ? "" : row.unit, factor: 1 };
}

type Range = Pick<ParameterRow, "min" | "max"> & Partial<Pick<ParameterRow, "default">>;

/**
 * A slider of 1000 steps is logarithmic where a range spans more than two decades; where it begins
 * at zero and its default is less than a hundredth of it, from a hundredth of the default on.
 */
export function sliderFromValue(row: Range, value: number): number {
  const low = logarithmicFrom(row);
  const [at, from, to] =
    low !== null
      ? [Math.log(Math.max(value, low)), Math.log(low), Math.log(row.max)]
      : [value, row.min, row.max];
  return Math.round((1000 * (at - from)) / (to - from));
}

export function valueFromSlider(row: Range, slider: number): number {
  if (slider <= 0) return row.min;
  if (slider >= 1000) return row.max;
  const share = slider / 1000;
  const low = logarithmicFrom(row);
  const value =
    low !== null ? low * (row.max / low) ** share : row.min + share * (row.max - row.min);
  return Number(value.toPrecision(3));
}

// Where the logarithmic part begins; null: it is linear.
function logarithmicFrom({ min, max, default: usual = 0 }: Range): number | null {
  if (min > 0) return max / min > 100 ? min : null;
  return min === 0 && usual > 0 && max / usual >= 100 ? usual / 100 : null;
}

export function shortNumber(value: number): string {
  return String(Number(value.toPrecision(4)));
}

/** The number that somebody typed; null: none, which is not zero. */
export function enteredNumber(text: string): number | null {
  const value = Number(text.trim() || Number.NaN);
  return Number.isFinite(value) ? value : null;
}

/** The rows in the order in which they are shown: what is changed most often first. */
export function stiffnessFirst<Row extends { name: string }>(rows: readonly Row[]): Row[] {
  const isFirst = ({ name }: Row) => name === "stiffness";
  return [...rows.filter(isFirst), ...rows.filter((row) => !isFirst(row))];
}

/** One parameter: a slider, a number and the way back to the default. */
class Row {
  private readonly slider: HTMLInputElement;
  private readonly number: HTMLInputElement;
  private readonly root: HTMLElement;
  private readonly back: HTMLButtonElement;
  private readonly factor: number;
  private held = 0; // [ms] when it was changed here last
  private typing = false;
  private current = Number.NaN; // what the program says

  constructor(
    parent: HTMLElement,
    readonly row: ParameterRow,
    prefix: string,
    private readonly set: (value: number) => void,
  ) {
    const { unit, factor } = shownUnit(row);
    this.factor = factor;
    const id = `${prefix}-${row.name}`;
    const name = row.name.replaceAll("_", " ");
    const title = row.meaning;
    this.slider = element("input", { type: "range", id, min: "0", max: "1000", title });
    this.number = element("input", { type: "number", step: "any", title });
    this.number.setAttribute("aria-label", `${name}, ${unit}`);
    this.back = element("button", { className: "back", title: "back to the default" }, "↺");
    this.back.setAttribute(
      "aria-label",
      `${name}: back to ${shortNumber(row.default * factor)} ${unit}`,
    );
    const label = element("label", { htmlFor: id }, /^r_\d|^r_c/.test(row.name) ? "" : name);
    if (row.symbol) label.prepend(symbol(row.symbol));
    const meaning =
      row.source === "ours" || !row.source ? row.meaning : `${row.meaning} · ${row.source}`;
    this.root = element(
      "div",
      { className: "row" },
      label,
      element("span", { className: "value" }, this.back, this.number, unit),
      this.slider,
      element("small", {}, meaning),
    );
    parent.append(this.root);
    this.slider.addEventListener("input", () =>
      this.change(valueFromSlider(row, +this.slider.value)),
    );
    this.number.addEventListener("input", () => (this.typing = true));
    this.number.addEventListener("change", () => {
      const entered = enteredNumber(this.number.value);
      if (entered === null) this.goBack();
      else this.change(entered / factor);
    });
    this.number.addEventListener("blur", () => this.typing && this.goBack());
    this.number.addEventListener("keydown", (event) => event.key === "Escape" && this.goBack());
    this.back.addEventListener("click", () => this.change(row.default));
  }

  allow(allowed: boolean): void {
    for (const input of [this.slider, this.number, this.back]) input.disabled = !allowed;
    this.root.classList.toggle("off", !allowed);
  }

  /** The program has refused something: what was changed here just now goes back. */
  refused(): void {
    if (performance.now() - this.held < 2000) this.goBack();
  }

  show(value: number): void {
    this.current = value;
    if (this.typing || performance.now() - this.held < 500) return; // being set
    this.slider.value = String(sliderFromValue(this.row, value));
    this.number.value = shortNumber(value * this.factor);
    const { default: standard } = this.row;
    this.root.classList.toggle("changed", Math.abs(value - standard) > 1e-9 * Math.abs(standard));
  }

  private goBack(): void {
    this.typing = false;
    this.held = 0;
    this.show(this.current);
  }

  private change(value: number): void {
    this.held = performance.now();
    this.typing = false;
    this.number.value = shortNumber(value * this.factor);
    this.slider.value = String(sliderFromValue(this.row, value));
    this.set(value);
  }
}

// r_c as r with a small c
function symbol(text: string): HTMLElement {
  const [base, small] = text.split("_");
  const made = element("i", {}, base!);
  if (small) made.append(element("sub", {}, small));
  return made;
}

/** `box:40x20x5mm` as people read it. */
export function toolName(tool: string): string {
  const [kind, rest = ""] = tool.split("?")[0]!.split(/:(.*)/);
  if (kind === "mesh") return rest.split("/").pop()!;
  return [kind, rest.replaceAll("x", " × ").replace(/(\d)(mm|cm|m)$/, "$1 $2")].join(" ").trim();
}

function sizeText(bytes: number): string {
  return bytes >= 1e9 ? `${(bytes / 1e9).toFixed(1)} GB` : `${(bytes / 1e6).toFixed(0)} MB`;
}

/** How long a recording is, and how large. */
export function recordingClock({ seconds, bytes }: State["recording"]): string {
  const whole = Math.floor(seconds);
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")} · ${sizeText(bytes)}`;
}

function recordingText(recording: State["recording"]): string {
  const { path, message, room } = recording;
  if (path === null) return message || "off";
  const left = room === null ? "" : `, room for ${sizeText(room)}`;
  return `${path}: ${recordingClock(recording)}${left}`;
}

/** The program's tables of what can be set. */
type Table = "parameters" | "safety" | "placement";
type Change = { name: string; value: number };

export class Panel {
  private readonly root = get("panel");
  private readonly method = get<HTMLSelectElement>("method-name");
  private readonly scene = get<HTMLSelectElement>("scene");
  private readonly tool = get<HTMLSelectElement>("tool");
  private readonly opener = element(
    "button",
    { id: "open-recording", className: "tool", hidden: true },
    element("span", {}, "Open recording"),
  );
  private rows: Record<Table, Row[]> = { parameters: [], safety: [], placement: [] };
  private hello: Hello | null = null;
  private safetyNow = 0;
  private safetySeen = 0;
  private role: Role | null = null;

  constructor(private readonly ask: (command: Command) => void) {
    const tabs = [...this.root.querySelectorAll<HTMLButtonElement>("[role=tab]")];
    tabs.forEach((tab, i) => {
      tab.addEventListener("click", () => this.open(tab.dataset.tab!));
      tab.addEventListener("keydown", (event) => {
        const step = event.key === "ArrowRight" ? 1 : event.key === "ArrowLeft" ? -1 : 0;
        if (step === 0) return;
        const next = tabs[(i + step + tabs.length) % tabs.length]!;
        next.focus();
        this.open(next.dataset.tab!);
      });
    });
    this.open("touch");
    this.method.addEventListener("change", () => this.ask({ method: this.method.value }));
    this.tool.addEventListener("change", () => {
      this.ask({ tool: this.tool.value });
      this.tool.blur(); // G turns the tool, and does not choose the gripper
    });
    this.scene.addEventListener("change", () => this.ask({ open: this.scene.value }));
    get("record").after(this.opener);
    this.opener.addEventListener("click", () => this.ask({ open: this.opener.value }));
  }

  open(tab: string): void {
    this.root.dataset.tab = tab;
    for (const button of this.root.querySelectorAll<HTMLButtonElement>("[role=tab]")) {
      const selected = button.dataset.tab === tab;
      button.setAttribute("aria-selected", String(selected));
      button.tabIndex = selected ? 0 : -1;
    }
  }

  introduce(hello: Hello): void {
    this.hello = hello;
    this.role = null; // rows are made anew
    const choices = (wanted: string) =>
      hello.scenes
        .filter(({ group }) => group === wanted)
        .map(({ uri, meaning }) =>
          element("option", { value: uri, title: `${uri}: ${meaning}` }, sceneName(uri)),
        );
    const groups = new Set(hello.scenes.map(({ group }) => group));
    this.scene.replaceChildren(
      ...[...groups].flatMap((group) =>
        group ? [element("optgroup", { label: group }, ...choices(group))] : choices(group),
      ),
    );
    get("scene-choice").hidden = hello.scenes.length === 0;
    get("open-file").hidden = hello.file_limit === 0;
    this.method.replaceChildren(
      ...hello.methods.map(({ name }) =>
        element("option", { value: name }, name.replaceAll("-", " ")),
      ),
    );
    this.tool.replaceChildren(
      ...hello.tools.map((tool) => element("option", { value: tool, title: tool }, toolName(tool))),
    );
    const build = (id: string, table: ParameterRow[], command: (change: Change) => Command) => {
      const parent = get(id);
      parent.replaceChildren();
      return table.map((row) => {
        const set = (value: number) => this.ask(command({ name: row.name, value }));
        return new Row(parent, row, id, set);
      });
    };
    this.rows = {
      parameters: build("parameters", stiffnessFirst(hello.parameters), (set) => ({ set })),
      safety: build("limits", hello.safety, (set_safety) => ({ set_safety })),
      placement: build("placement", hello.placement, (place) => ({ place })),
    };
    const tally = (id: string, flags: Hello["flags"]) =>
      get(id).replaceChildren(
        ...flags.map(({ name, meaning }) =>
          element("li", { title: meaning }, name.replaceAll("_", " "), element("b", {}, "0")),
        ),
      );
    tally("flags", hello.flags);
    tally("interventions", hello.safety_flags);
  }

  /** The program has refused what the page asked for. */
  refused(): void {
    for (const row of Object.values(this.rows).flat()) row.refused();
  }

  /** @param safety SafetyFlag bits of the newest ticks */
  showSafety(safety: number, now: number): void {
    if (safety === this.safetyNow && now - this.safetySeen < 200) return;
    this.safetyNow = safety;
    this.safetySeen = now;
    [...get("interventions").children].forEach((item, i) =>
      item.classList.toggle("now", (safety & (1 << i)) !== 0),
    );
  }

  /** @param inOwnFrame  cameras whose poses nobody knows */
  update(state: State, inOwnFrame: boolean): void {
    this.showRecording(state);
    if (document.activeElement !== this.method) this.method.value = state.method;
    if (document.activeElement !== this.tool) this.tool.value = state.tool;
    if (document.activeElement !== this.scene) this.scene.value = state.cameras[0]?.uri ?? "";
    const method = this.hello?.methods.find(({ name }) => name === state.method);
    write("method-meaning", method?.meaning ?? "");
    say("stiffness-warning", warningText(state.device.warnings));
    for (const [table, rows] of Object.entries(this.rows))
      for (const row of rows) row.show(state[table as Table][row.row.name] ?? Number.NaN);
    this.showRole(state.role);
    const count = (id: string, counts: readonly number[]) =>
      [...get(id).children].forEach((item, i) => {
        write(item.lastElementChild!, (counts[i] ?? 0).toLocaleString("en"));
        item.classList.toggle("some", (counts[i] ?? 0) > 0);
      });
    count("flags", state.flag_ticks);
    count("interventions", state.interventions);
    const total = state.interventions.reduce((sum, n) => sum + n, 0);
    write(
      "safety-lead",
      `${total.toLocaleString("en")} interventions of the safety chain; suspected pop-throughs: ` +
        `${state.pop_throughs}.`,
    );
    this.showFacts(state, inOwnFrame);
  }

  // Greys out what the page may not do, and says why.
  private showRole(role: Role): void {
    if (role === this.role) return;
    this.role = role;
    this.method.disabled = this.scene.disabled = this.tool.disabled = role !== "operating";
    get<HTMLButtonElement>("open-file").disabled = role !== "operating";
    for (const row of this.rows.parameters) row.allow(role !== "looking");
    for (const row of this.rows.safety) row.allow(maySetLimit(role, row.row));
    for (const row of this.rows.placement) row.allow(role === "operating");
    for (const [part, why] of Object.entries(whyNot(role))) say(`${part}-why`, why);
  }

  /** Clock and size in the record button while it records; the way into the recording after. */
  private showRecording({ recording, role }: State): void {
    const text = recording.path ? recordingClock(recording) : "Record";
    write(get("record").querySelector("span")!, text);
    this.opener.hidden = recording.open === null || role !== "operating";
    this.opener.title = recording.message;
    this.opener.value = recording.open ?? "";
  }

  private showFacts(state: State, inOwnFrame: boolean): void {
    const { servo } = state;
    const microseconds = (seconds: number) => `${(1e6 * seconds).toFixed(1)} µs`;
    type Fact = [string, string];
    const facts: Fact[] = [
      ...state.cameras.map(({ uri, kind, sensor, rate, state: how }, i): Fact => [
        state.cameras.length > 1 ? `Camera ${i + 1}` : "Camera",
        `${uri} · ${kind}${sensor === "unknown" ? "" : `, ${sensor}`}` +
          (how === "live" ? `, ${rate.toFixed(1)} Hz` : ` · ${how}`),
      ]),
      ...(inOwnFrame && state.cameras[0]?.frames !== 1
        ? [["World", "the camera frame, as no pose is known: the HIP moves with it"] as Fact]
        : []),
      [
        "Hand",
        [state.device.uri, state.device.kind, state.device.fault].filter(Boolean).join(" · "),
      ],
      ["Servo", `${servo.rate.toLocaleString("en")} Hz · ${servo.realtime}`],
      ["Ticks", servo.ticks.toLocaleString("en")],
      ["Late ticks", servo.late_ticks.toLocaleString("en")],
      ["Tick time, 99 %", microseconds(servo.compute_p99)],
      ["Wake-up, 99 %", microseconds(servo.wake_up_p99)],
      ["Frames used", servo.frames_adopted.toLocaleString("en")],
      ["Frames overtaken", servo.frames_dropped.toLocaleString("en")],
      ["Pop-throughs", `${state.pop_throughs} suspected`],
      [
        "Energy made",
        `${(1e3 * state.energy.relative.made).toFixed(1)} mJ in ` +
          `${state.energy.contacts.toLocaleString("en")} contacts, ` +
          `above 0.1 mJ in ${state.energy.relative.generating.toLocaleString("en")}`,
      ],
      ["Recording", recordingText(state.recording)],
      ["This page", roleNames[state.role].name],
      ["Version", this.hello?.version ?? ""],
    ];
    const list = get("facts");
    const texts = facts.flat();
    if (list.children.length !== texts.length)
      list.replaceChildren(...texts.map((_, i) => element(i % 2 === 0 ? "dt" : "dd")));
    texts.forEach((text, i) => write(list.children[i]!, text));
  }
}
