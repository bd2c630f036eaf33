// SPDX-License-Identifier: Apache-2.0
#include "blindcorner/io/program_name.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "blindcorner/forward/error.h"

namespace blindcorner {
namespace {

TEST(ProgramName, IsTheLibrarysUnlessAProgramStatesItsOwn) {
  const std::string before = program_name();
  EXPECT_THAT(before, ::testing::MatchesRegex("blindcorner [0-9]+\\.[0-9]+\\.[0-9]+"));
  set_program_name("robot 3 (main)");
  EXPECT_EQ(program_name(), "robot 3 (main)");
  set_program_name(before);
}

// It is the last cell of a journal's line, told from numbers by its first letter.
TEST(ProgramName, RefusesWhatIsNoCellOfATable) {
  for (const char* wrong : {"", "3 robots", "a,b", "a\nb"}) {
    EXPECT_THROW(set_program_name(wrong), Error) << wrong;
  }
}

}  // namespace
}  // namespace blindcorner
