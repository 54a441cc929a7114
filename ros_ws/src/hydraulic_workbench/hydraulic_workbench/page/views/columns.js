// What the columns of a table are: channel, unit and sign, chosen from lists.
import { html, nothing } from "../core/html.js";

function select(label, value, options, pick) {
  return html`<select aria-label=${label} @change=${(event) => pick(event.target.value)}>
    ${options.map(([key, text]) => html`<option value=${key} ?selected=${key === value}>${text}</option>`)}</select>`;
}

function channelRow(map, shown, channel, changed) {
  const entry = map.channels[channel.name];
  const columns = [["", "not there"], ...shown.header.map((name) => [name, name])];
  const pick = (name) => {
    if (name) map.channels[channel.name] = { unit: channel.units[0], sign: 1, scale: 1, offset: 0, ...entry, column: name };
    else delete map.channels[channel.name];
    changed();
  };
  return html`<tr><th>${channel.title}</th>
    <td>${select(`Column of ${channel.title}`, entry ? String(entry.column) : "", columns, pick)}</td>
    <td>${entry ? select(`Unit of ${channel.title}`, entry.unit, channel.units.map((unit) => [unit, unit]), (unit) => { entry.unit = unit; changed(); }) : nothing}</td>
    <td>${entry ? html`<button class="small" aria-pressed=${entry.sign === -1} title="Turn the sign round"
      @click=${() => { entry.sign = -(entry.sign ?? 1); changed(); }}>${entry.sign === -1 ? "− turned" : "+"}</button>` : nothing}</td>
    <td>${entry ? html`<input type="number" step="any" aria-label=${`Scale of ${channel.title}`} .value=${String(entry.scale ?? 1)}
      @change=${(event) => { entry.scale = Number(event.target.value) || 1; changed(); }}>` : nothing}</td></tr>`;
}

function timeRow(map, shown, changed) {
  const rate = map.time.column === undefined;
  const columns = [["", "no column: a fixed rate"], ...shown.header.map((name) => [name, name])];
  const pick = (name) => { map.time = name ? { column: name, unit: map.time.unit ?? shown.time_units[0] } : { dt: 0.001 }; changed(); };
  const rates = [0.01, 0.005, 0.002, 0.001, 0.0005, 0.0002, 0.0001];
  return html`<tr><th>Time</th><td>${select("Column of time", rate ? "" : String(map.time.column), columns, pick)}</td>
    <td>${rate
      ? select("Rate", String(map.time.dt), rates.map((dt) => [String(dt), `${Math.round(1 / dt)} Hz`]), (dt) => { map.time.dt = Number(dt); changed(); })
      : select("Unit of time", map.time.unit, shown.time_units.map((unit) => [unit, unit]), (unit) => { map.time.unit = unit; changed(); })}</td><td></td><td></td></tr>`;
}

/** The form; `map` is changed in place, then `changed` is called. */
export function columnsForm(map, shown, changed) {
  return html`<div class="scroll"><table class="columns-map"><thead><tr><th>Channel</th><th>Column</th><th>Unit</th><th>Sign</th><th>Scale</th></tr></thead>
      <tbody>${timeRow(map, shown, changed)}${shown.channels.map((channel) => channelRow(map, shown, channel, changed))}</tbody></table></div>
    <div class="row"><span class="soft small">Where the sampling is uneven</span>
      ${select("Where the sampling is uneven", map.sampling ?? "strict", [["strict", "refuse it"], ["resample", "resample"], ["split", "split the record"]],
        (value) => { map.sampling = value; changed(); })}</div>
    ${shown.yaml ? html`<details><summary>The map as YAML</summary><pre class="yaml">${shown.yaml}</pre></details>` : nothing}`;
}
