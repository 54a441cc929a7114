// What must not be missed, above every tab: no server, a latched stop, a plant that failed; and what to do next.
import { html, nothing } from "../core/html.js";
import { state } from "../core/store.js";
import { operates, plant, reset } from "../core/actions.js";
import { fixed } from "../core/format.js";
import { guide } from "./guide.js";

function stopped() {
  const now = plant();
  if (!now.stopped || now.kind === "none") return nothing;
  const took = state.stop?.phase === "done" && state.stop.milliseconds < 2000
    ? ` Acknowledged after ${fixed(state.stop.milliseconds, 0)} ms.` : "";
  return html`<div class="banner stop" role="alert">
    <span><strong>${now.stop_reason && now.stop_reason !== "emergency stop" ? "Fault." : "Emergency stop."}</strong> The drive is at 0 V and stays there.${took}
      ${now.stop_reason && now.stop_reason !== "emergency stop" ? html`<span class="soft">${now.stop_reason}</span>` : nothing}</span>
    <button id="reset" ?disabled=${!operates() || now.may_reset === false} @click=${reset}>Reset…</button>
  </div>`;
}

function failed() {
  const now = plant();
  if (now.phase !== "failed") return nothing;
  return html`<div class="banner" role="alert"><span><strong>The plant failed.</strong> ${now.text}</span></div>`;
}

function offline() {
  if (state.online || !state.hello) return nothing;
  return html`<div class="banner" role="alert"><span><strong>The server does not answer.</strong>
    Nothing here is live. The plant's watchdog takes the drive to 0 V when its source is silent.</span></div>`;
}

function pressed() {
  if (state.stop?.phase !== "asked") return nothing;
  return html`<div class="banner stop" role="alert"><span><strong>Emergency stop sent.</strong></span></div>`;
}

export const banners = () => html`${offline()}${pressed()}${stopped()}${failed()}${guide()}`;
