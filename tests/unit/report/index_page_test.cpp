// SPDX-License-Identifier: Apache-2.0
/// The index of a directory links all that it holds, and harms nothing that is not this program's.
#include "blindcorner/report/index_page.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "report/html.h"
#include "unit/io/io_test_files.h"

namespace blindcorner {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class Index : public ::testing::Test {
 protected:
  void write(const fs::path& name, const std::string& text) const {
    fs::create_directories((directory_ / name).parent_path());
    test::write_text((directory_ / name).string(), text);
  }
  std::string written() const {
    write_index(directory_.string());
    return test::read_text((directory_ / "index.html").string());
  }

  test::TemporaryFolder folder_;
  fs::path directory_ = folder_.path();
};

TEST_F(Index, ListsPagesWithHeadlinesAndFilesWithTheirMeaning) {
  write("drive.html", script_page("street", "The car hit the cyclist.", "{}", {}));
  write("path.html", plain_page("Path on a map", "Found.", ""));
  write("path.json", "{}");
  write("one.exr", "");
  write("notes.txt", "the user's own");
  EXPECT_THAT(
      written(),
      AllOf(HasSubstr("href=\"drive.html\""), HasSubstr("The car hit the cyclist."),
            HasSubstr("<b>Path on a map</b><br>Found.</p>"), HasSubstr("href=\"path.json\""),
            HasSubstr("href=\"one.exr\""), Not(HasSubstr("notes"))));
  // Whatever was there: the same directory has the same index.
  EXPECT_EQ(written(), written());
}

TEST_F(Index, LinksDirectoriesBelow) {
  write("trials.html", plain_page("Trials", "", ""));
  write("replay/los_3/drive.html", plain_page("One", "", ""));
  write("fit/index.html", plain_page("Results in fit", "", ""));
  write("fit/result.html", plain_page("Fit", "", ""));
  EXPECT_THAT(written(),
              AllOf(HasSubstr("href=\"replay/los_3/drive.html\""),
                    HasSubstr("href=\"fit/result.html\""), Not(HasSubstr("index.html"))));
}

TEST_F(Index, NamesMeanNothingInHtmlOrAddresses) {
  write("a <b>&\"#1?%.html", plain_page("<i>", "5 < 6 & 7", ""));
  EXPECT_THAT(written(), AllOf(HasSubstr("href=\"a%20%3Cb%3E%26%22%231%3F%25.html\""),
                               HasSubstr(">a &lt;b&gt;&amp;&quot;#1?%.html</a>"),
                               HasSubstr("&lt;i&gt;"), HasSubstr("5 &lt; 6 &amp; 7")));
}

TEST_F(Index, LeavesAloneWhatIsNotItsOwn) {
  write("path.html", plain_page("Path", "", ""));
  write("index.html", "<h1>My site</h1>");
  EXPECT_EQ(written(), "<h1>My site</h1>");
}

TEST_F(Index, NeedsAPage) {
  write("path.json", "{}");
  EXPECT_EQ(written(), "");
  refresh_index(directory_.string());
  EXPECT_FALSE(fs::exists(directory_ / "index.html"));
}

}  // namespace
}  // namespace blindcorner
