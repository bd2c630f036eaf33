// SPDX-License-Identifier: Apache-2.0
// Studies of many drives: which trials they hold, that none is run twice, and what a kill leaves.
// Nothing is driven here: outcomes are made up.
#include "blindcorner/simulation/trials.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <set>

#include "blindcorner/forward/error.h"
#include "blindcorner/simulation/paired_difference.h"
#include "blindcorner/simulation/trial_journal.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;

Drive street_drive() {
  Drive drive;
  drive.trials = {6, 12, 6};
  return drive;
}

std::vector<Trial> plan(int trials, int error_trials = 0) {
  TrialsOptions options;
  options.trials = trials;
  options.error_trials = error_trials;
  options.perceptions = {"los", "oracle"};
  return plan_trials(street_drive(), options);
}

/// An outcome that depends on the trial alone, with digits that rounding would lose.
TrialResult made_up(const Trial& trial) {
  TrialResult result;
  result.trial = trial;
  result.outcome = trial.seed % 3 == 0 ? "collision" : "reached";
  result.clearance = trial.speed / 7;
  result.time = 60 / trial.speed;
  std::vector<ReliabilityCount> counts(kMapBins);
  counts[2] = {9, 2, trial.speed / 3};
  result.map = ReliabilityDiagram(counts);
  return result;
}

class Journal : public ::testing::Test {
 protected:
  /// The tables after a run that ends after `most` trials, as a kill would end it.
  std::string run(const std::vector<Trial>& trials, int threads, std::size_t most = 1000) const {
    TrialJournal journal(directory_.string(), "{\"seed\": 1}\n");
    std::size_t done = 0;
    try {
      run_trials(open_trials(trials, journal.results()), threads, made_up,
                 [&](const TrialResult& result) {
                   if (done++ >= most) throw Error("killed");
                   journal.add(result);
                 });
    } catch (const Error& /*killed*/) {
    }
    std::vector<TrialResult> results = journal.results();
    sort_trials(results);
    return trials_csv(street_drive().trials, results) + errors_csv(street_drive().trials, results);
  }

  test::TemporaryFolder folder_;
  fs::path directory_ = folder_.path();
};

TEST(TrialPlan, SpeedsLieInTheirZonesAndZonesAreEquallyFull) {
  std::array<int, 6> count{};
  for (const Trial& trial : plan(60)) {
    EXPECT_GE(trial.speed, 6 + trial.zone);
    EXPECT_LE(trial.speed, 7 + trial.zone);
    ++count.at(static_cast<std::size_t>(trial.zone));
  }
  EXPECT_THAT(count, ::testing::Each(20));  // ten of each of two perceptions
}

TEST(TrialPlan, PerceptionsShareSeedsAndSpeeds) {
  const std::vector<Trial> trials = plan(12);
  std::set<std::uint64_t> seeds;
  for (std::size_t i = 0; i < trials.size(); i += 2) {
    EXPECT_NE(trials[i].perception, trials[i + 1].perception);
    EXPECT_EQ(trials[i].seed, trials[i + 1].seed);
    EXPECT_EQ(trials[i].speed, trials[i + 1].speed);
    seeds.insert(trials[i].seed);
  }
  EXPECT_EQ(seeds.size(), 12U);
}

TEST(TrialPlan, ALargerStudyHoldsTheSmallerOne) {
  const std::vector<Trial> small = plan(7), large = plan(20);
  for (std::size_t i = 0; i < small.size(); ++i) {
    EXPECT_EQ(trial_key(small[i]), trial_key(large[i]));
    EXPECT_EQ(small[i].speed, large[i].speed);
  }
}

TEST(TrialPlan, InjectedErrorsFillTheirBinsAtAllSpeeds) {
  std::array<std::set<int>, kErrorBins> zones;
  for (const Trial& trial : plan(1, kErrorBins * 6)) {
    if (trial.error > 0) zones.at(static_cast<std::size_t>(trial.error)).insert(trial.zone);
  }
  for (const std::set<int>& in_bin : zones) EXPECT_EQ(in_bin.size(), 6U);
}

TEST(TrialPlan, OptionsOutOfRangeAreRefused) {
  EXPECT_THROW(plan(0), Error);
  EXPECT_THROW(plan(1, -1), Error);
}

TEST_F(Journal, AnInterruptedStudyEndsWithTheSameBytes) {
  const std::vector<Trial> trials = plan(30, 14);
  const std::string whole = run(trials, 1);
  fs::remove(directory_ / "journal.csv");
  run(trials, 2, 11);
  EXPECT_NE(run(trials, 2, 0), whole);
  EXPECT_EQ(run(trials, 2), whole);
}

TEST_F(Journal, ATornLineIsRunAgain) {
  const std::vector<Trial> trials = plan(6);
  const std::string whole = run(trials, 1);
  const fs::path path = directory_ / "journal.csv";
  fs::resize_file(path, fs::file_size(path) - 5);
  EXPECT_EQ(run(trials, 1), whole);
  EXPECT_EQ(run(trials, 1), whole);  // the file was mended, not only read around
}

TEST_F(Journal, FinishedTrialsAreNotRunAgain) {
  const std::vector<Trial> trials = plan(6);
  run(trials, 1);
  TrialJournal journal(directory_.string(), "{\"seed\": 1}\n");
  for (const Trial& trial : open_trials(trials, journal.results())) {
    ADD_FAILURE() << "would run seed " << trial.seed;
  }
}

TEST_F(Journal, AnotherStudyIsRefusedByName) {
  run(plan(2), 1);
  try {
    TrialJournal journal(directory_.string(), "{\"seed\": 2}\n");
    FAIL() << "took another study's directory";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("another study (seed differ"));
  }
}

TEST_F(Journal, OneProcessAtATime) {
  const TrialJournal journal(directory_.string(), "{}\n");
  EXPECT_THROW(TrialJournal(directory_.string(), "{}\n"), Error);
}

TEST_F(Journal, ALineThatIsNoResultIsNamed) {
  run(plan(2), 1);
  std::ofstream(directory_ / "journal.csv", std::ios::app) << "nonsense\n";
  EXPECT_THROW(TrialJournal(directory_.string(), "{\"seed\": 1}\n"), Error);
}

TEST(RunTrials, AFailureEndsTheStudy) {
  const auto fails = [](const Trial&) -> TrialResult { throw Error("no such scene"); };
  EXPECT_THROW(run_trials(plan(4), 2, fails, [](const TrialResult&) {}), Error);
}

TEST(PairedDifference, AsPublished) {
  // Newcombe 1998, table II, method 10: 36, 12, 2, 0.
  const PairedDifference d = paired_difference({36, 12, 2, 0});
  EXPECT_NEAR(d.value, 0.2, 1e-12);
  EXPECT_NEAR(d.low, 0.0569, 5e-5);
  EXPECT_NEAR(d.high, 0.3404, 5e-5);
}

TEST(PairedDifference, HoldsAtTheBorders) {
  const PairedDifference same = paired_difference({20, 0, 0, 0});
  EXPECT_EQ(same.value, 0);
  EXPECT_LT(same.low, 0);
  EXPECT_GT(same.high, 0);
  const PairedDifference all = paired_difference({0, 20, 0, 0});
  EXPECT_EQ(all.value, 1);
  EXPECT_GT(all.low, 0.5);
  EXPECT_LE(all.high, 1);
  EXPECT_EQ(paired_difference({}).low, -1);
}

/// A study with risks holds the one without, under other keys; the drive file's own risk is not
/// driven twice.
TEST(Trials, RisksAreDrivenBesideTheDriveFiles) {
  TrialsOptions options;
  options.trials = 3;
  options.perceptions = {"los"};
  Drive drive = street_drive();
  drive.traffic_risk = 0.02;
  const std::vector<Trial> own = plan_trials(drive, options);
  options.risks = {0.001, 0.02, 0.1};
  const std::vector<Trial> varied = plan_trials(drive, options);
  EXPECT_EQ(varied.size(), 9U);
  std::set<std::pair<std::string, std::uint64_t>> keys;
  for (const Trial& trial : varied) keys.insert(trial_key(trial));
  EXPECT_EQ(keys.size(), 9U);
  for (const Trial& trial : own) {
    EXPECT_TRUE(keys.contains(trial_key(trial)));
    EXPECT_EQ(drive_of(drive, trial).traffic_risk, 0.02);
  }
  EXPECT_EQ(drive_of(drive, varied[1]).traffic_risk, 0.001);
  EXPECT_EQ(drive_of(drive, varied[1]).risk, 0.001);
  options.risks = {1.5};
  EXPECT_THROW(plan_trials(drive, options), Error);
}

/// Costs go through the journal and stand in the table's last columns; journals of earlier versions
/// have none.
TEST(Trials, CostsComeBackFromTheJournal) {
  TrialResult result = made_up(plan(1).front());
  EXPECT_FALSE(parse_journal_line(journal_line(result)).with_costs);
  result.with_costs = result.present = true;
  result.impact_speed = 5.25;
  result.hardest_braking = 8.8;
  result.trial.risk = 0.001;
  const std::string line = journal_line(result);
  const TrialResult back = parse_journal_line(line);
  EXPECT_EQ(journal_line(back), line);
  EXPECT_TRUE(back.with_costs && back.present);
  EXPECT_EQ(back.impact_speed, 5.25);
  EXPECT_EQ(back.trial.risk, 0.001);
  const std::string table = trials_csv(street_drive().trials, {back});
  EXPECT_THAT(table, testing::HasSubstr(
                         ",length_m,risk,present,impact_m_per_s,hardest_braking_m_per_s2\n"));
  EXPECT_THAT(table, testing::EndsWith(",0.001,1,5.250,8.800\n"));
}

TEST(Trials, ALineOfTheJournalComesBackWhole) {
  for (const Trial& trial : plan(6, 14)) {
    const TrialResult result = made_up(trial);
    const std::string line = journal_line(result);
    EXPECT_EQ(journal_line(parse_journal_line(line)), line);
  }
  // The program that drove the trial is its last cell, behind a corner's speed or without one.
  TrialResult named = made_up(plan(6).front());
  named.program = "blindcorner 0.1.0 (1a2b3c4)";
  for (const double speed : {0.0, 8.5}) {
    named.corner_speed = speed;
    const TrialResult back = parse_journal_line(journal_line(named));
    EXPECT_EQ(back.program, named.program);
    EXPECT_EQ(back.corner_speed, speed);
  }
  // Lines that an earlier version has written name none.
  named.program.clear();
  EXPECT_EQ(parse_journal_line(journal_line(named)).program, "");
  EXPECT_THROW(parse_journal_line("los,0,12"), Error);
}

}  // namespace
}  // namespace blindcorner
