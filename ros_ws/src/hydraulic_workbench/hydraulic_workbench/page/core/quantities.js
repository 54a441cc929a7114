// How an SI unit is shown: the server's table, which is that of the reports.
import { state } from "./store.js";
import { shown } from "./format.js";

/** {factor, unit} of an SI unit. */
export const displayOf = (unit) => state.hello?.display?.[unit] ?? { factor: 1, unit: unit === "1" ? "" : unit ?? "" };

/** An SI value as people read it. */
export const quantity = (value, unit, count = 4) => shown(value, displayOf(unit), count);
