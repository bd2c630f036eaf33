// SPDX-License-Identifier: Apache-2.0
/// What a reader asks of the values of a document while it reads them: the source of the JSON
/// schemas (json_schema.h), so that fields, types and ranges stand in one place, the readers.
#pragma once

#include <cstddef>
#include <list>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "forward/support/number_range.h"

namespace blindcorner {

/// One value of a document, or a field that is not there, and what was asked of it.
struct JsonRecord {
  using Json = nlohmann::ordered_json;

  std::string pointer;                ///< JSON pointer into the document
  std::optional<Json::value_t> type;  ///< as it was read; empty: absent

  std::optional<NumberRange> number;
  bool whole = false;  ///< of the number
  bool boolean = false, text = false;
  std::vector<std::string> words;  ///< one of these

  bool array = false;
  std::size_t least = 0;            ///< elements
  std::optional<std::size_t> size;  ///< exactly
  std::list<JsonRecord> elements;   ///< lists: readers keep pointers to their items

  bool object = false;
  std::vector<std::string> names;  ///< fields that may be there; empty: any
  std::list<std::pair<std::string, JsonRecord>> fields;

  /// Which others may or must stand beside a field depends on its word, or on whether it is there.
  /// The word that holds as JSON, in quotes (also where it is absent and a default holds), or there
  /// or absent; empty: nothing depends.
  std::string decides;
  std::string deciders;    ///< which fields decide together; empty: this one alone
  bool forbidden = false;  ///< what stands beside it excludes it

  JsonRecord& field(std::string_view name, const Json* value);
  JsonRecord& element(std::size_t index, const Json* value);
  const JsonRecord* find(std::string_view name) const;

  /// Asks what a value of this content is asked by: for documents that are only written.
  void observe(const Json& content);
};

/// While it lives, readers of that file on this thread record what they ask.
class JsonRecording {
 public:
  JsonRecording(JsonRecord& root, std::string file);
  ~JsonRecording();
  JsonRecording(const JsonRecording&) = delete;
  JsonRecording& operator=(const JsonRecording&) = delete;

  /// Where the reader of this file records; null: nowhere.
  static JsonRecord* root_for(const std::string& file);

 private:
  JsonRecord& root_;
  std::string file_;
};

}  // namespace blindcorner
