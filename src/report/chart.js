// SPDX-License-Identifier: Apache-2.0
// Draws `charts` (see chart_page.cpp), logarithmic on both axes. D3 version 3.
(function () {
  'use strict';
  const width = 560, height = 330;
  const margin = {top: 28, right: 12, bottom: 40, left: 62};
  const colors = ['#1f77b4', '#d62728', '#2ca02c', '#9467bd', '#ff7f0e', '#17becf', '#8c564b'];

  function extent(chart) {
    const xs = [], ys = [];
    chart.series.forEach(s => s.points.forEach(p => { xs.push(p[0]); ys.push(p[1]); }));
    chart.rules.forEach(r => (r.vertical ? xs : ys).push(r.at));
    const wide = v => [d3.min(v) / 1.4, d3.max(v) * 1.4];
    return {x: wide(xs), y: wide(ys)};
  }

  function axis(scale, orient, ticks) {
    const decades = scale.ticks().filter(t => Math.abs(Math.log10(t) % 1) < 1e-9 ||
        Math.abs(Math.abs(Math.log10(t) % 1) - 1) < 1e-9);
    const values = decades.length > 1 ? decades : scale.ticks().filter((t, i) => i % 2 === 0);
    return d3.svg.axis().scale(scale).orient(orient).tickValues(values)
        .tickFormat(t => (t >= 0.001 && t < 1e5) ? String(+t.toPrecision(3)) : t.toExponential(0))
        .innerTickSize(-ticks).outerTickSize(0);
  }

  function draw(chart) {
    const svg = d3.select('.charts').append('svg').attr('width', width).attr('height', height);
    svg.append('text').attr('class', 'title').attr('x', margin.left).attr('y', 14)
        .text(chart.title);
    const range = extent(chart);
    const x = d3.scale.log().domain(range.x).range([margin.left, width - margin.right]);
    const y = d3.scale.log().domain(range.y).range([height - margin.bottom, margin.top]);
    const bottom = svg.append('g').attr('class', 'axis')
        .attr('transform', 'translate(0,' + (height - margin.bottom) + ')')
        .call(axis(x, 'bottom', height - margin.top - margin.bottom));
    const left = svg.append('g').attr('class', 'axis')
        .attr('transform', 'translate(' + margin.left + ',0)')
        .call(axis(y, 'left', width - margin.left - margin.right));
    [bottom, left].forEach(g => g.selectAll('.tick line').attr('class', 'minor'));
    svg.append('text').attr('x', width - margin.right).attr('y', height - 8)
        .attr('text-anchor', 'end').text(chart.x);
    svg.append('text').attr('transform', 'translate(14,' + margin.top + ') rotate(-90)')
        .attr('text-anchor', 'end').text(chart.y);
    chart.rules.forEach(r => {
      const p = r.vertical ? [x(r.at), margin.top, x(r.at), height - margin.bottom]
                           : [margin.left, y(r.at), width - margin.right, y(r.at)];
      svg.append('line').attr('class', 'rule').attr('x1', p[0]).attr('y1', p[1])
          .attr('x2', p[2]).attr('y2', p[3]);
      svg.append('text').attr('x', r.vertical ? p[0] + 3 : p[2] - 3)
          .attr('y', r.vertical ? p[1] + 10 : p[1] - 4)
          .attr('text-anchor', r.vertical ? 'start' : 'end').text(r.name);
    });
    chart.series.forEach((s, i) => {
      const color = colors[i % colors.length];
      if (s.line && s.points.length > 1) {
        svg.append('path').attr('fill', 'none').attr('stroke', color).attr('stroke-width', 1.5)
            .attr('d', d3.svg.line().x(p => x(p[0])).y(p => y(p[1]))(s.points));
      }
      svg.append('g').selectAll('circle').data(s.points).enter().append('circle')
          .attr('cx', p => x(p[0])).attr('cy', p => y(p[1])).attr('r', s.line ? 2.5 : 4.5)
          .attr('fill', s.line ? color : 'none').attr('stroke', color)
          .append('title').text(p => s.name + (p[2] ? ', ' + p[2] : '') + '\n' +
              chart.x + ': ' + p[0].toPrecision(3) + '\n' + chart.y + ': ' + p[1].toPrecision(3));
      svg.append('text').attr('x', width - margin.right - 6).attr('y', margin.top + 14 + 14 * i)
          .attr('text-anchor', 'end').style('fill', color).text(s.name);
    });
  }

  charts.forEach(draw);
})();
