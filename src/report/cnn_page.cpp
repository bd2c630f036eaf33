// SPDX-License-Identifier: Apache-2.0
#include "report/cnn_page.h"

#include <algorithm>
#include <cmath>

#include "report/chart.h"
#include "report/formatted.h"
#include "report/html.h"

namespace blindcorner {
namespace {

/// Most points that a curve is drawn with.
constexpr std::size_t kMaxCurvePoints = 400;

constexpr const char* kUnits =
    "<p>Lengths in m, angles in rad, yaw modulo the shape's symmetry.</p>\n";
constexpr const char* kPicture =
    "<p>Seen from above, y up. Green: true places; orange: estimates, joined to them; large dots: "
    "sensors; dashed: the search region.</p>\n";

Chart loss_chart(CnnArchitecture network, const CnnTrainingResult& result) {
  const bool wide = network == CnnArchitecture::wide;
  Chart chart{"loss", "epoch",
              wide ? "negative log likelihood of the normalised outputs, mean of the ensemble"
                   : "mean squared error of the normalised outputs"};
  chart.logarithmic = !wide;  // the loss is negative where the likelihood is above one
  chart.width = 460;          // a telephone shows it at three quarters of that
  chart.height = 320;
  ChartSeries training{wide ? "training" : "training, with dropout"}, validation{"held back"};
  const std::size_t count = result.history.size();
  // Points at equal factors of the epoch: a logarithmic axis shows them at equal distances.
  double next = 1;
  const double factor = std::pow(static_cast<double>(std::max<std::size_t>(count, 2)),
                                 1.0 / static_cast<double>(kMaxCurvePoints));
  for (std::size_t i = 0; i < count; ++i) {
    const auto epoch = static_cast<double>(i + 1);
    if (epoch < next && i + 1 < count) continue;
    next = std::max(epoch + 1, epoch * factor);
    training.points.push_back({epoch, result.history[i].training});
    validation.points.push_back({epoch, result.history[i].validation});
  }
  chart.series = {training, validation};
  if (result.epoch < static_cast<int>(count)) {
    chart.rules.push_back({"kept", static_cast<double>(result.epoch), true});
  }
  return chart;
}

/// Share of estimates with at most a given distance from the truth.
Chart distance_chart(std::vector<double> distances) {
  Chart chart{"errors of position", "distance from the truth, m", "share of captures"};
  chart.width = 460;
  chart.height = 320;
  std::ranges::sort(distances);
  ChartSeries series{"", {{0, 0}}};
  const std::size_t count = distances.size();
  const std::size_t step = 1 + count / kMaxCurvePoints;
  for (std::size_t n = 1; n <= count; ++n) {
    if (n % step != 0 && n != count) continue;  // the largest is always shown
    series.points.push_back(
        {distances[n - 1], static_cast<double>(n) / static_cast<double>(count)});
  }
  chart.series = {series};
  return chart;
}

}  // namespace

std::string training_csv(const std::vector<CnnEpoch>& history) {
  std::string csv = "epoch,training_loss,validation_loss\n";
  for (std::size_t i = 0; i < history.size(); ++i) {
    csv += formatted("%zu,%.9g,%.9g\n", i + 1, history[i].training, history[i].validation);
  }
  return csv;
}

std::string training_page(const Scene& scene, const CnnTrainingOptions& options,
                          const CnnTrainingResult& result,
                          const std::vector<PointEstimate>& held_back) {
  std::string body = formatted(
      "<p>The %s network: %zu epochs in batches of %d, Adam at a rate of %g, %.0f s (%.0f s of "
      "processor time); "
      "the weights are those after epoch %d.</p>\n",
      cnn_architecture_name(options.network).c_str(), result.history.size(), options.batch,
      options.learning_rate, result.run_time.wall, result.run_time.processor, result.epoch);
  body += charts_html({loss_chart(options.network, result)});
  if (held_back.empty()) return plain_page("Training for " + scene.name, "", body);
  body += formatted("<p>Errors on the %zu captures held back:</p>\n", held_back.size()) + kUnits +
          point_errors_html(point_errors(scene, held_back)) + kPicture +
          point_estimates_svg(scene, held_back);
  return plain_page("Training for " + scene.name, point_errors_headline(scene, held_back), body);
}

std::string cnn_evaluation_page(const Scene& scene, const CnnDescription& network,
                                const std::vector<PointEstimate>& estimates, double capture_ms) {
  std::string body =
      formatted("<p>%zu captures, %.3g ms each (median). The network was trained for ",
                estimates.size(), capture_ms) +
      html_safe(network.scene) +
      formatted(" on %d captures, of which %g %% were held back.</p>\n", network.training.captures,
                100 * network.training.validation_share);
  body += kUnits + point_errors_html(point_errors(scene, estimates));
  const std::vector<double> distances = position_errors(scene, estimates);
  if (!distances.empty()) body += charts_html({distance_chart(distances)});
  body += kPicture;
  return plain_page("Errors of the network on " + scene.name,
                    point_errors_headline(scene, estimates),
                    body + point_estimates_svg(scene, estimates));
}

}  // namespace blindcorner
