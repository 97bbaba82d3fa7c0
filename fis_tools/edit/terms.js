// A variable: its terms as curves with handles, its value as a slider, and the terms' numbers as fields.
export default {
  template: `
  <section class="variable" v-if="variable" v-memo="[variable, value, degrees]" :aria-label="kind + ' ' + variable.name">
    <div class="variable-head">
      <h3>{{ variable.name }} <span>{{ variable.unit }}</span></h3>
      <output v-if="value !== null">{{ short(value) }} {{ variable.unit }}</output>
    </div>
    <p class="about">{{ variable.description }}</p>
    <div class="names" aria-hidden="true">
      <b v-for="term in variable.terms" :style="{ left: share(term.middle) + '%', color: term.colour }">{{ term.name }}</b>
    </div>
    <div class="plot" v-if="variable.has_sets">
      <svg viewBox="0 0 1000 100" preserveAspectRatio="none" aria-hidden="true">
        <line x1="0" x2="1000" y1="50" y2="50" class="half" />
        <path v-for="(term, n) in variable.terms" :d="term.path + (term.shape === 'between' ? '' : ' L1000 100 L0 100Z')" :style="{ fill: term.colour, fillOpacity: 0.05 + 0.3 * (degrees[n] || 0) }" />
        <path v-for="term in variable.terms" :d="term.path" fill="none" :style="{ stroke: term.colour }" />
      </svg>
      <i class="here" v-if="value !== null" :style="{ left: share(value) + '%' }"></i>
      <template v-for="term in variable.terms">
        <input v-for="handle in term.handles" :key="term.name + handle.key" class="handle" type="range" :min="variable.minimum" :max="variable.maximum" :step="span / 400"
          :value="handle.x" :style="{ top: 100 - 100 * handle.y + '%', color: term.colour }" :class="{ out: share(handle.x) % 100 === 0 }"
          :title="term.name + ', ' + words(handle.key) + ': ' + short(handle.value)" :aria-label="term.name + ', ' + words(handle.key)" :aria-valuetext="short(handle.value) + ' ' + variable.unit"
          @pointerdown="gesture++" @focus="gesture++" @input="say('drag', term, { key: handle.key, value: $event.target.value - handle.origin })" />
      </template>
    </div>
    <input v-if="kind === 'input'" type="range" class="value" :min="variable.minimum" :max="variable.maximum" :step="span / 200"
      :value="value" :aria-label="variable.name + ', value'" :aria-valuetext="short(value) + ' ' + variable.unit" @input="slide" />
    <div class="ends" aria-hidden="true"><span>{{ short(variable.minimum) }}</span><span>{{ short(variable.maximum) }}</span></div>
    <details>
      <summary>numbers</summary>
      <form class="wide" @change="settle" @focusout="settle" @submit.prevent><table>
        <tr v-for="term in variable.terms" :key="term.name">
          <td><input class="name" :value.attr="term.name" :aria-label="'name of ' + term.name" @change="say('rename', term, { name: $event.target.value })" /></td>
          <td><select v-if="variable.has_sets" :aria-label="'shape of ' + term.name" @change="say('reshape', term, { shape: $event.target.value })">
            <option v-for="shape in new Set([...variable.shapes, term.shape])" :value="shape" :selected.attr="shape === term.shape || null">{{ words(shape) }}</option></select></td>
          <td><label v-for="number in term.numbers" :key="number.key"><span>{{ words(number.key) }}</span>
            <input inputmode="decimal" :value.attr="number.value" :aria-label="term.name + ', ' + words(number.key)" @change="say('number', term, { key: number.key, value: $event.target.value })" /></label></td>
          <td><button type="button" class="quiet" :aria-label="'remove ' + term.name" @click="say('remove', term)">✕</button></td>
        </tr>
      </table></form>
      <button type="button" class="quiet" @click="say('add', {})">+ term</button>
    </details>
  </section>`,
  props: { kind: String, start: Number },
  data() {
    return { variable: null, value: this.start ?? null, degrees: [], gesture: 0, touches: 0 };
  },
  computed: {
    span() { return this.variable.maximum - this.variable.minimum; },
  },
  methods: {
    share(x) { return Math.min(100, Math.max(0, (100 * (x - this.variable.minimum)) / this.span)); },
    short(x) { return Math.abs(x) < 1e-9 * this.span ? "0" : String(Number(Number(x).toPrecision(4))); },
    words(key) { return key.replaceAll("_", " "); },
    // what the page held a few touches ago would pull a handle from under the hand that drags it
    show(variable, touches) { if (touches >= this.touches) this.variable = variable; },
    // the answer of an inference: degrees of the terms and, of an output, its value
    infer(degrees, value = this.value) { [this.degrees, this.value] = [degrees, value]; },
    slide(event) {
      this.value = Number(event.target.value);
      this.$emit("slide", { value: this.value });
    },
    // a whole drag is one change to undo, and so are the keys pressed on one handle
    say(what, term, told) {
      if (what !== "drag") this.gesture++;
      this.$emit("touch", { what, term: term.name, gesture: this.gesture, touches: ++this.touches, ...told });
    },
    // what is typed stays until it is said; then the fields show what holds
    settle(event) { event.currentTarget.reset(); },
  },
};
