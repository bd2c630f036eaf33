// SPDX-License-Identifier: Apache-2.0
/// JSON schemas of the formats that readers read. They are made from what the readers ask
/// (json_record.h) of examples. An example shows which fields there are. The reader shows what each
/// field holds and accepts, and which fields stand beside each other. Whether a field may be left
/// out is tried.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "io/json_record.h"

namespace blindcorner {

class SchemaSource {
 public:
  using Json = JsonRecord::Json;
  /// Reads a document as the file of that path. Throws Error where it is refused.
  using Read = std::function<void(const Json& document, const std::string& path)>;

  /// Without a reader, the examples show what is written: fields that all of them have are
  /// required.
  explicit SchemaSource(Read read = nullptr) : read_(std::move(read)) {}

  /// Throws Error where the reader refuses the example.
  void add(Json example, const std::string& path);

  /// Throws Error where a field that the reader knows is in no example.
  Json schema(const std::string& title) const;

 private:
  struct Example {
    Json document;
    std::string path;
    JsonRecord record;
  };
  struct Place {
    const JsonRecord* record;
    const Example* example;
  };
  using Places = std::vector<Place>;
  /// Places of one object in which the fields that decide together have the same values.
  struct Variant {
    std::map<std::string, std::string> decided;  ///< by field
    Places places;
  };

  Json describe(const Places& places) const;
  /// `items` is the schema of elements that are objects; null: the examples show it.
  Json describe_array(const Places& places, Json items) const;
  Json describe_object(const Places& places) const;
  /// What holds for each variant of the deciding fields that the examples show.
  Json describe_variants(const std::vector<Variant>& variants,
                         const std::vector<std::string>& names,
                         const std::vector<std::string>& always) const;
  Json describe_variant(const Variant& variant, const std::vector<std::string>& names,
                        const std::vector<std::string>& always) const;
  static std::vector<std::vector<Variant>> variants_of(const Places& places);
  /// Fields of that name, also below objects' names ("front.x_m" for "*.x_m").
  static Places fields_of(const Places& places, const std::string& name);
  bool can_be_left_out(const Places& places, const std::string& name) const;
  /// Whether the reader accepts any of these documents after `change` at its place.
  bool accepts_any(const Places& places,
                   const std::function<void(Json& document, const Place& place)>& change) const;
  /// Names of which one has to be there, whichever; empty: none has to be.
  std::vector<std::string> needed_choice(const Places& places) const;
  std::vector<std::string> required(const Places& places,
                                    const std::vector<std::string>& names) const;

  Read read_;
  std::vector<std::shared_ptr<const Example>> examples_;
};

/// Schema of a JSON Merge Patch (RFC 7396) for such documents: any part of a document, and null for
/// a field that is taken out.
SchemaSource::Json patch_schema(SchemaSource::Json schema);

}  // namespace blindcorner
