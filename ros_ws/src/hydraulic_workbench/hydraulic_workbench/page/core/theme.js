// Dark or light: as the system says, until the user chooses.
import { changed } from "./store.js";

const ORDER = ["auto", "light", "dark"];
const dark = matchMedia("(prefers-color-scheme: dark)");

function remembered() {
  try {
    return localStorage.getItem("theme");
  } catch {
    return null; // storage is switched off
  }
}

let name = ORDER.includes(remembered()) ? remembered() : "auto";

function apply() {
  if (name === "auto") delete document.documentElement.dataset.theme;
  else document.documentElement.dataset.theme = name;
  dispatchEvent(new CustomEvent("theme"));
  changed();
}

/** "auto", "light" or "dark". */
export function theme() {
  return name;
}

/** Whether the page is dark now. */
export function isDark() {
  return name === "dark" || (name === "auto" && dark.matches);
}

/** The next of auto, light, dark. */
export function nextTheme() {
  name = ORDER[(ORDER.indexOf(name) + 1) % ORDER.length];
  try {
    localStorage.setItem("theme", name);
  } catch {
    // it holds for this page only
  }
  apply();
}

dark.addEventListener("change", apply);
apply();
