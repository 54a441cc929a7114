// Effects of the library that a simulated plant has and its model file has not.
import { html, nothing } from "../core/html.js";
import { changed } from "../core/store.js";
import { digits, words } from "../core/format.js";

function slider(values, parameter) {
  const { factor = 1, unit = "" } = parameter.display || {};
  const value = values[parameter.name] ?? parameter.default;
  const least = parameter.minimum ?? 0;
  const most = parameter.maximum ?? Math.max(4 * Math.abs(parameter.default), 1e-6);
  const to = Math.min(most, Math.max(4 * Math.abs(parameter.default), least + 1e-9) || most);
  return html`<label class="field" title=${parameter.description ?? ""}>
    <span class="row spread"><span>${words(parameter.name)}</span><b>${digits(value * factor, 3)} ${unit}</b></span>
    <input type="range" min=${least} max=${to} step=${(to - least) / 100} .value=${String(value)}
      @input=${(event) => { values[parameter.name] = Number(event.target.value); changed(); }}></label>`;
}

/** A list to choose from; `hidden` (name → values) is changed in place. */
export function hiddenEffects(effects, hidden) {
  const toggle = (effect) => {
    if (effect.name in hidden) delete hidden[effect.name];
    else hidden[effect.name] = {};
    changed();
  };
  const subsystems = [...new Set(effects.map((effect) => effect.subsystem))];
  return html`<div class="effects">${subsystems.map((subsystem) => html`
    <fieldset><legend>${words(subsystem)}</legend>
      ${effects.filter((effect) => effect.subsystem === subsystem).map((effect) => html`
        <div class="effect">
          <label class="check" title=${effect.summary}><input type="checkbox" .checked=${effect.name in hidden}
            @change=${() => toggle(effect)}> ${effect.title || words(effect.name)}</label>
          ${effect.name in hidden ? html`<div class="stack tight inset">${effect.parameters.map((one) => slider(hidden[effect.name], one))}</div>` : nothing}
        </div>`)}
    </fieldset>`)}</div>`;
}
