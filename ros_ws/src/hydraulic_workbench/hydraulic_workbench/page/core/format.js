// Numbers and times for people: engineering units, three to four digits.

/** `value` with about so many significant digits, without exponents where they can be avoided. */
export function digits(value, count = 4) {
  if (value === null || value === undefined || Number.isNaN(value)) return "–";
  if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return minus(value.toExponential(Math.max(0, count - 2)));
  const places = Math.max(0, count - 1 - Math.floor(Math.log10(size)));
  return minus(value.toFixed(Math.min(places, 6)));
}

/** With a fixed number of places, so that a running value does not jump. */
export function fixed(value, places) {
  return Number.isFinite(value) ? minus(value.toFixed(places)) : "–";
}

const minus = (text) => text.replace(/-/g, "−");

/** An SI value in the unit people read: `display` is {factor, unit}. */
export function shown(value, display, count = 4) {
  if (value === null || value === undefined) return "–";
  const { factor = 1, unit = "" } = display || {};
  return `${digits(value * factor, count)}${unit ? ` ${unit.replaceAll("*", "·")}` : ""}`;
}

/** "9.42 × noise". */
export const overNoise = (value) => (Number.isFinite(value) ? `${digits(value, 3)} × noise` : "–");

/** A share as per cent. */
export const percent = (share) => {
  if (!Number.isFinite(share)) return "–";
  const value = 100 * share;
  if (value > 99.9 && value < 100) return "> 99.9 %";
  if (value > 0 && value < 0.1) return "< 0.1 %";
  return `${digits(value, 3)} %`;
};

/** Seconds as "12 s", "3:05 min". */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  if (seconds < 90) return `${seconds < 10 ? digits(seconds, 2) : Math.round(seconds)} s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 90) return `${minutes}:${String(Math.floor(seconds % 60)).padStart(2, "0")} min`;
  return `${digits(minutes / 60, 2)} h`;
}

/** Time of day, and the day where it is not today's. */
export function clock(unix) {
  if (!unix) return "";
  const then = new Date(unix * 1000);
  const time = then.toLocaleTimeString([], { hour: "2-digit", minute: "2-digit" });
  return then.toDateString() === new Date().toDateString() ? time : `${then.toLocaleDateString()} ${time}`;
}

/** "valve_deadband" as words; a port keeps its capital: "pressure A". */
export const words = (name) => String(name ?? "").replaceAll("_", " ").replace(/\b[ab]$/, (port) => port.toUpperCase());

/** Words as a heading: its first letter is a capital. */
export const heading = (text) => text[0].toUpperCase() + text.slice(1);

/** The last parts of a path; the whole is for a tooltip. */
export function shortPath(path, parts = 2) {
  const all = String(path ?? "").split("/");
  return all.length > parts + 1 ? `…/${all.slice(-parts).join("/")}` : all.join("/");
}
