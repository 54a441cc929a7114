// The top of the page: what runs, enable and reset, and the stop button that is always there.
import { html, nothing } from "../core/html.js";
import { state } from "../core/store.js";
import { brand, helpIcon, theme as themeIcon } from "../core/icons.js";
import { emergencyStop } from "../core/connection.js";
import { disable, enable, operates, plant, plantRuns, stoppable } from "../core/actions.js";
import { nextTheme, theme } from "../core/theme.js";
import { digits } from "../core/format.js";
import { showHelp } from "./help.js";

function condition() {
  const now = plant();
  if (!state.online) return html`<span class="chip poor"><i class="dot"></i>server gone</span>`;
  if (now.kind === "none" || now.phase === "stopped") return html`<span class="chip"><i class="dot"></i>no plant</span>`;
  if (now.phase === "failed") return html`<span class="chip poor"><i class="dot"></i>failed</span>`;
  if (now.phase !== "running") return html`<span class="chip accent"><i class="spinner"></i>starting</span>`;
  if (now.stopped) return html`<span class="chip poor"><i class="dot"></i>stopped</span>`;
  if (now.enabled) return html`<span class="chip good"><i class="dot"></i>enabled</span>`;
  return html`<span class="chip fair"><i class="dot"></i>disabled</span>`;
}

function rate() {
  const health = state.bench.health;
  if (!plantRuns() || !health || !Number.isFinite(health.rate)) return nothing;
  return html`<span class="soft small rate">${digits(health.rate, 3)} Hz</span>`;
}

function enabling() {
  const now = plant();
  if (!plantRuns() || now.stopped) return nothing;
  if (now.enabled) return html`<button id="disable" ?disabled=${!operates()} @click=${disable}>Disable</button>`;
  return html`<button id="enable" ?disabled=${!operates() || now.may_enable === false} @click=${enable}>Enable…</button>`;
}

export function header() {
  return html`<header class="top">
    <div class="brand">${brand}<span>Workbench</span></div>
    <div class="plant-state" aria-live="polite">
      ${condition()}
      ${plant().kind !== "none" ? html`<span class="name" title=${plant().text || ""}>${plant().name}</span>` : nothing}
      ${rate()}
      ${state.role === "watch" && state.hello ? html`<span class="chip">watching only</span>` : nothing}
    </div>
    <div class="tools">
      ${enabling()}
      <button class="icon quiet help" aria-label="Help and keys" title="Help and keys (?)" @click=${showHelp}>${helpIcon()}</button>
      <button class="icon quiet theme" aria-label=${`Theme: ${theme()}`} title=${`Theme: ${theme()}`} @click=${nextTheme}>${themeIcon()}</button>
      <button class="stop" id="stop" ?disabled=${!state.online || !stoppable()} title="Emergency stop: 0 V at once, latched until reset"
        @click=${emergencyStop}>STOP <kbd>space</kbd></button>
    </div>
  </header>`;
}
