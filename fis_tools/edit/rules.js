// The rules: full tables as tables, others as a list; a press on a term turns it to the next one.
export default {
  template: `
  <div class="rules">
    <template v-if="tables && !listed">
      <div class="wide" v-for="table in tables"><table class="matrix">
        <caption v-if="table.title">where {{ table.title }}</caption>
        <thead><tr><th>{{ broken(table.corner) }}</th><th v-for="head in table.heads" scope="col">{{ broken(head) }}</th></tr></thead>
        <tbody><tr v-for="row in table.rows"><th scope="row">{{ broken(row.head) }}</th>
          <td v-for="n in row.rules"><button type="button" class="term" :class="state(rules[n])" :style="tone(rules[n].then[0])"
            :aria-label="label(rules[n], rules[n].then[0])" @click="turn($event, n, 'then', 0)" @keydown="keys($event, n, 'then', 0)" @focus="select(n)">
            {{ broken(rules[n].then[0].term) }}<i :style="{ width: 100 * (strengths[n] || 0) + '%' }"></i></button></td></tr></tbody>
      </table></div>
    </template>
    <div class="wide" v-else><table class="list">
      <thead><tr><th>rule</th><th v-for="head in inputs" scope="col">{{ broken(head) }}</th><th v-for="head in outputs" scope="col">{{ broken(head) }}</th></tr></thead>
      <tbody><tr v-for="(rule, n) in rules" :class="{ selected: n === selected }">
        <th scope="row"><button type="button" class="quiet" :aria-label="'rule ' + (n + 1)" :aria-pressed="n === selected" @click="select(n)">{{ n + 1 }}</button></th>
        <td v-if="!rule.cells" :colspan="inputs.length">{{ rule.words }}</td>
        <td v-for="cell in rule.cells || []"><button v-if="cell" type="button" class="term if" :aria-label="label(rule, cell)"
          @click="turn($event, n, 'if', cell.place)" @keydown="keys($event, n, 'if', cell.place)" @focus="select(n)">{{ cell.before }} {{ broken(cell.term) }}</button></td>
        <td v-for="output in outputs"><template v-for="then in rule.then"><button v-if="then.variable === output" type="button" class="term" :class="state(rule)" :style="tone(then)"
          :aria-label="label(rule, then)" @click="turn($event, n, 'then', then.place)" @keydown="keys($event, n, 'then', then.place)" @focus="select(n)">{{ broken(then.term) }}{{ then.weight === 1 ? "" : " × " + then.weight }}<i :style="{ width: 100 * (strengths[n] || 0) + '%' }"></i></button></template></td>
      </tr></tbody></table></div>
  </div>`,
  props: { rules: Array, tables: Array, inputs: Array, outputs: Array, listed: Boolean },
  data() {
    return { strengths: [], selected: null };
  },
  methods: {
    // names may break after an underscore
    broken(name) { return name.replaceAll("_", "_\u200b"); },
    fire(strengths) { this.strengths = strengths; },
    tone(then) { return { background: then.tint, borderColor: then.colour }; },
    state(rule) { return { changed: rule.changed }; },
    label(rule, cell) {
      return `rule ${rule.number}: ${rule.words}; ${cell.variable} is ${cell.term}${rule.changed ? ", changed" : ""}; turn`;
    },
    select(rule) { this.selected = rule; this.$emit("select", { rule }); },
    turn(event, rule, side, place) {
      this.select(rule);
      this.$emit("turn", { rule, side, place, step: event.shiftKey ? -1 : 1 });
    },
    keys(event, rule, side, place) {
      const step = { ArrowDown: -1, ArrowUp: 1 }[event.key];
      if (!step) return;
      event.preventDefault();
      this.$emit("turn", { rule, side, place, step });
    },
  },
};
