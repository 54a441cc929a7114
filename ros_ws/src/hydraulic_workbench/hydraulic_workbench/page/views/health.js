// Health at a glance: what arrives how regularly, and what every node says of itself.
import { html, nothing } from "../core/html.js";
import { state } from "../core/store.js";
import { live } from "../core/stream.js";
import { digits, duration } from "../core/format.js";

const TONE = { ok: "good", warn: "fair", error: "poor", stale: "poor" };

function figure(title, value, unit) {
  return html`<div class="figure"><span class="soft small">${title}</span><b>${value}</b><span class="soft small">${unit}</span></div>`;
}

function row(one) {
  const values = Object.entries(one.values ?? {});
  return html`<details class="node-row"><summary>
      <i class="dot" style=${`color:var(--${TONE[one.level] ?? "soft"})`}></i>
      <span class="grow"><strong>${one.name}</strong> <span class="soft">${one.level === "stale" ? `silent for ${duration(one.age)}` : one.message}</span></span>
    </summary>
    <dl class="facts small">${values.map(([key, value]) => html`<dt>${key}</dt><dd>${value}</dd>`)}</dl></details>`;
}

export function health() {
  const now = state.bench.health;
  if (!now || state.bench.plant?.kind === "none") return nothing;
  const faults = (now.rows ?? []).filter((one) => one.level !== "ok");
  return html`<section class="card" aria-label="Health"><header><h2>Health</h2>
      <span class="chip ${TONE[now.level] ?? ""}"><i class="dot"></i>${now.level}</span></header>
    <div class="figures">
      ${figure("Rate", digits(now.rate, 4), "Hz")}
      ${figure("Jitter", digits(now.jitter_ms, 2), "ms")}
      ${figure("Age", digits(now.age_ms, 2), "ms")}
      ${figure("Lost", String(now.lost ?? "–"), live.gaps ? `${live.gaps} on the page` : "samples")}
    </div>
    ${faults.length ? html`<div class="stack tight faults">${faults.map((one) => html`
      <p class="notice ${TONE[one.level]}"><strong>${one.name}</strong><br>${one.level === "stale" ? `silent for ${duration(one.age)}` : one.message}</p>`)}</div>` : nothing}
    <details class="all-nodes"><summary>All nodes (${(now.rows ?? []).length})</summary>${(now.rows ?? []).map(row)}</details>
  </section>`;
}
