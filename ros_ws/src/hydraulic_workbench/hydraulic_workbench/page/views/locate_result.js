// Which balance is broken, and whose it is.
import { html, nothing } from "../core/html.js";
import { digits, percent, words } from "../core/format.js";
import { quantity } from "../core/quantities.js";

export function locateResult(doc) {
  const attribution = doc.attribution ?? [];
  return html`<section class="card" aria-label="Location"><header><h2>Where it breaks</h2></header>
    <p class="verdict ${doc.verdict.level}">${doc.verdict.text}</p>
    <div class="two-tables">
      <div class="scroll"><table><thead><tr><th>Balance</th><th class="number">Broken by</th><th class="number">Residual</th></tr></thead>
        <tbody>${doc.balances.map((one) => html`<tr><th>${one.title}</th><td class="number"><b>${digits(one.ratio, 3)} × noise</b></td>
          <td class="number">${quantity(one.residual_rms, one.unit, 3)}</td></tr>`)}</tbody></table></div>
      ${attribution.length ? html`<div class="scroll"><table><thead><tr><th>Subsystem</th><th>Explains</th></tr></thead>
        <tbody>${attribution.map((one) => html`<tr><th>${words(one.name)}</th><td class="share-cell"><span class="share"><span style=${`width:${100 * Math.max(0.01, one.share ?? 0)}%`}></span></span>
          <span>${percent(one.share)}</span></td></tr>`)}</tbody></table></div>` : nothing}
    </div>
    <ul class="findings">${(doc.findings ?? []).map((one) => html`<li>${one.text}</li>`)}</ul></section>`;
}
