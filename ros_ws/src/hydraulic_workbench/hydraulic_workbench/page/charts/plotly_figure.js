// A figure of the report. Plotly is fetched when the first one is opened, never before.
import { css } from "./colours.js";

let library = null;

function plotly() {
  library ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = "/plotly.min.js";
    script.onload = () => resolve(window.Plotly);
    script.onerror = () => { library = null; reject(new Error("Plotly could not be loaded.")); };
    document.head.append(script);
  });
  return library;
}

export class PlotlyFigure extends HTMLElement {
  /** `figure`: {data, layout} as the report has it. */
  set figure(figure) {
    if (this.spec === figure) return;
    this.spec = figure;
    if (this.isConnected) this.build();
  }

  connectedCallback() {
    this.recolour = () => this.drawn && this.library.relayout(this, dressed({ font: this.layout?.font }));
    addEventListener("theme", this.recolour);
    if (this.spec) this.build();
  }

  disconnectedCallback() {
    removeEventListener("theme", this.recolour);
    if (this.drawn) this.library.purge(this);
    this.drawn = false;
  }

  async build() {
    const { spec } = this;
    try {
      this.library = await plotly();
    } catch (error) {
      this.textContent = error.message;
      return;
    }
    if (!this.isConnected || spec !== this.spec) return;
    await this.library.newPlot(this, spec.data, dressed({ ...spec.layout }), {
      responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d", "autoScale2d"],
    });
    this.drawn = true;
  }
}

function dressed(layout) {
  layout.font = { ...layout.font, color: css("ink") };
  layout.hoverlabel = { bgcolor: css("card"), font: { color: css("ink") } };
  return layout;
}

customElements.define("plotly-figure", PlotlyFigure);
