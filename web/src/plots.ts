// SPDX-License-Identifier: Apache-2.0
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { element, write } from "./dom";
import type { Sample } from "./protocol";

const SPAN = 10; // [s] shown
const INTERVAL = 66; // [ms] between drawings
const GAP = 0.25; // [s] without samples: no line is drawn across

// Of the quantities, that are shown until more are asked for. Numbers beside the scene, of a newer
// tick, say them.
const FIRST = 2;

interface Quantity {
  title: string;
  unit: string;
  colour: string; // a CSS variable
  of(sample: Sample): number;
  digits: number;
  least: number; // what the axis shows at least
  signed?: true; // it may be below 0
}

const QUANTITIES: readonly Quantity[] = [
  { title: "Force", unit: "N", colour: "--force", of: (s) => s.force, digits: 2, least: 1 },
  {
    title: "Hand below the surface", unit: "mm", colour: "--hip",
    of: (s) => 1e3 * s.penetration, digits: 1, least: 2,
  },
  {
    title: "Energy given in this contact", unit: "mJ", colour: "--force",
    of: (s) => 1e3 * s.relative, digits: 2, least: 0.5, signed: true,
  },
  {
    title: "… with the surface's motion", unit: "mJ", colour: "--hip",
    of: (s) => 1e3 * s.absolute, digits: 2, least: 0.5, signed: true,
  },
  { title: "Steps a tick", unit: "", colour: "--calm", of: (s) => s.steps, digits: 0, least: 4 },
  {
    title: "Tick time", unit: "µs", colour: "--time",
    of: (s) => 1e6 * s.tickTime, digits: 1, least: 10,
  },
];

interface Plot {
  quantity: Quantity;
  chart: uPlot;
  value: HTMLOutputElement;
  host: HTMLElement;
}

/** The last seconds of what the ticks said, one chart a quantity. */
export class Plots {
  private samples: (Sample & { gap?: boolean })[] = [];
  private plots: Plot[] = [];
  private drawn = 0;
  private quantities: readonly Quantity[] = QUANTITIES.slice(0, FIRST);

  constructor(private readonly parent: HTMLElement) {
    this.build();
    new ResizeObserver(() => this.fit()).observe(parent);
  }

  add(samples: readonly Sample[]): void {
    const newest = samples.at(-1);
    if (!newest) return;
    // The program was started anew: its clock may have gone back.
    if (this.samples.length > 0 && newest.t < this.samples.at(-1)!.t)
      this.samples = [];
    const last = this.samples.at(-1);
    if (last && samples[0]!.t - last.t > GAP)
      this.samples.push({ ...last, t: last.t + 1e-3, gap: true });
    this.samples.push(...samples);
    const first = this.samples.findIndex((sample) => sample.t >= newest.t - SPAN);
    if (first > 0) this.samples.splice(0, first);
  }

  /** All quantities, or the first. */
  show(all: boolean): void {
    this.quantities = all ? QUANTITIES : QUANTITIES.slice(0, FIRST);
    this.recolour();
  }

  /** What the plots show, the oldest first. */
  history(): readonly Sample[] {
    return this.samples;
  }

  /** @param pause [ms] between drawings where drawing is slow */
  draw(now: number, pause: number): void {
    if (now - this.drawn < Math.max(INTERVAL, pause) || this.parent.offsetParent === null) return;
    this.drawn = now;
    const newest = this.samples.at(-1);
    if (!newest) return;
    const times = this.samples.map((sample) => sample.t - newest.t);
    for (const [i, { quantity, chart, value, host }] of this.plots.entries()) {
      const values = this.samples.map((sample) => (sample.gap ? null : quantity.of(sample)));
      chart.setData([times, values]);
      const text = `${values.at(-1)!.toFixed(quantity.digits)} ${quantity.unit}`.trim();
      write(value, i < FIRST ? quantity.unit : text);
      host.setAttribute("aria-label", `${quantity.title}, last ${SPAN} seconds; now ${text}`);
    }
  }

  /** Takes the colours of the page's theme. */
  recolour(): void {
    for (const plot of this.plots) plot.chart.destroy();
    this.build();
    this.drawn = 0;
  }

  private build(): void {
    this.parent.replaceChildren();
    const style = getComputedStyle(document.documentElement);
    const css = (name: string) => style.getPropertyValue(name).trim();
    // The page's letters grow with the window: those of the axes do too.
    const grown = (pixels: number) => Math.round((pixels * parseFloat(style.fontSize)) / 14);
    this.plots = this.quantities.map((quantity, i) => {
      // It changes fifteen times a second.
      const value = element("output", { ariaLive: "off" });
      const host = element("div", { className: "canvas", role: "img" });
      const header = element("header", {}, element("b", {}, quantity.title), value);
      this.parent.append(element("article", { className: "plot" }, header, host));
      const last = i === this.quantities.length - 1;
      const axis = {
        stroke: css("--muted"),
        font: `${grown(11)}px ${style.fontFamily}`,
        grid: { stroke: css("--line"), width: 1 },
        ticks: { show: false },
      };
      const colour = css(quantity.colour);
      const fading = `color-mix(in srgb, ${colour} 14%, transparent)`;
      const chart = new uPlot(
        {
          width: 300,
          height: 80,
          padding: [6, 14, last ? 0 : 4, 0],
          cursor: { show: false },
          legend: { show: false },
          scales: {
            x: { time: false, range: [-SPAN, 0] },
            y: {
              range: (_, min, max) => [
                quantity.signed ? 1.08 * Math.min(min ?? 0, -quantity.least) : 0,
                1.08 * Math.max(max ?? 0, quantity.least),
              ],
            },
          },
          axes: [
            { ...axis, show: last, size: grown(22), values: (_, v) => v.map((t) => `${t} s`) },
            { ...axis, size: grown(36), space: grown(24) },
          ],
          series: [
            {},
            { stroke: colour, width: 1.6, fill: fading, points: { show: false } },
          ],
        },
        [[], []],
        host,
      );
      return { quantity, chart, value, host };
    });
    this.fit();
  }

  private fit(): void {
    for (const { chart, host } of this.plots) {
      const { clientWidth: width, clientHeight: height } = host;
      if (width > 0 && (width !== chart.width || height !== chart.height))
        chart.setSize({ width, height });
    }
  }
}
