// A chart of Apache ECharts in the colours of the page, light or dark.
import { echarts } from "nicegui-echart";

const isDark = matchMedia("(prefers-color-scheme: dark)");

/** Return a theme of the colours that the page has now. */
function theme(element) {
  const colour = (name) => {
    element.style.color = `var(--${name})`;
    return getComputedStyle(element).color;
  };
  const [ink, muted, rule] = ["ink", "muted", "rule"].map(colour);
  element.style.color = "";
  const axis = {
    axisLine: { lineStyle: { color: muted } }, axisLabel: { color: muted }, nameTextStyle: { color: ink }, splitLine: { lineStyle: { color: [rule] } },
  };
  const legend = { textStyle: { color: ink }, pageTextStyle: { color: muted }, pageIconColor: ink, pageIconInactiveColor: rule };
  return { backgroundColor: "transparent", textStyle: { color: ink }, valueAxis: axis, categoryAxis: axis, legend };
}

export default {
  template: "<div></div>",
  mounted() {
    this.chart = echarts.init(this.$el, theme(this.$el), { renderer: "canvas" });
    this.onScheme = () => this.chart.setTheme(theme(this.$el));
    isDark.addEventListener("change", this.onScheme);
    this.observer = new ResizeObserver(() => this.chart.resize());
    this.observer.observe(this.$el);
  },
  beforeUnmount() {
    isDark.removeEventListener("change", this.onScheme);
    this.observer.disconnect();
    this.chart.dispose();
  },
  methods: {
    draw(options) { this.chart.setOption(options); },
  },
};
