// The page: draws the tab that is open whenever something has changed.
import { html, render, keyed } from "./core/html.js";
import { onChange, state, changed } from "./core/store.js";
import "./core/theme.js";
import { connect } from "./core/connection.js";
import { dialogs } from "./core/dialogs.js";
import { messages } from "./core/messages.js";
import { listenToKeys } from "./core/keys.js";
import { live } from "./core/stream.js";
import { header } from "./views/header.js";
import { banners } from "./views/banners.js";
import { currentTab, rail, TABS } from "./views/tabs.js";
import { plantView } from "./views/plant.js";
import { liveView } from "./views/live.js";
import { experimentView } from "./views/experiment.js";
import { recordsView } from "./views/records.js";
import { diagnoseView } from "./views/diagnose.js";

const VIEWS = { plant: plantView, live: liveView, experiment: experimentView, records: recordsView, diagnose: diagnoseView };
const place = document.getElementById("app");

function page() {
  const tab = currentTab();
  return html`
    ${header()}
    ${rail()}
    <main tabindex="-1" id="main">
      ${banners()}
      ${keyed(tab, viewOf(tab))}
    </main>
    ${messages()}
    ${dialogs()}`;
}

/** A tab that cannot be shown takes nothing else with it: the stop button stays. */
function viewOf(tab) {
  try {
    return VIEWS[tab]();
  } catch (error) {
    console.error(error);
    return html`<p class="notice poor" role="alert">This tab cannot be shown: ${error.message}</p>`;
  }
}

function draw() {
  render(page(), place);
  const { title } = TABS.find((tab) => tab.name === currentTab());
  document.title = `${title} – Hydraulic workbench`;
}

place.replaceChildren();
if (location.search.includes("token=")) history.replaceState(null, "", location.pathname + location.hash); // not into bookmarks
onChange(draw);
addEventListener("hashchange", () => {
  changed();
  scrollTo(0, 0);
});
listenToKeys();
connect();
draw();

// For measurements from outside: what was received and drawn.
window.workbench = { live, state };
