# tablegen as a build step of GNU make. In a Makefile:
#
#   TABLEGEN ?= tablegen
#   include $(or $(shell $(TABLEGEN) paths --make),$(error $(TABLEGEN) does not run: install piezo-tablegen or give TABLEGEN=PATH))
#   $(eval $(call tablegen_build,scan.toml,build/scan))
#
#   CPPFLAGS += -Ibuild/scan $(build/scan_CPPFLAGS)
#   OBJECTS := main.o $(build/scan_SOURCES:.c=.o)
#   firmware: $(OBJECTS)
#   $(OBJECTS): $(build/scan_OPTIONS)
#
# builds scan.toml into the directory build/scan before make looks at anything else, and gives
#
#   build/scan_SOURCES     the C sources: NAME.c, NAME_program.c (not if header-only), and the runtime dac_*.c
#   build/scan_HEADERS     NAME.h, dac_*.h; compile with -Ibuild/scan
#   build/scan_CPPFLAGS    -DDAC_TABLE_STORAGE_BITS=.. -DDAC_OUTPUT_STORAGE_BITS=..: the widths that this scan needs, for all files;
#                          -DDAC_SHAPING=.. where its output is shaped, -DDAC_SPLINE=1 for cubic tables,
#                          -DDAC_SLOW_PART=1 for a scan at an angle, -DDAC_PIXEL_TABLE=1 for a sine
#   build/scan_OPTIONS     a file that changes when build/scan_CPPFLAGS do: let all objects depend on it
#   build/scan_VERILOG     dac_*.v
#   build/scan_MEMORY      the .mem files
#   build/scan_FILES       all files of the build, NAME.vh, manifest.json and those of other formats too
#
#   $(eval $(call tablegen_runtime,survey.toml detail.toml,build/scans))
#
# builds several scans, of any widths, into build/scans/survey and build/scans/detail, for one runtime: build/scans_SOURCES
# and so on are those of all of them, with the dac_*.c once. build/scans_CPPFLAGS names the header build/scans_OPTIONS,
# which has the highest of each option that any of them needs; and has -I of all directories.
#
# Paths are relative to where make runs. They cannot have spaces, since make cannot.
#
# How it works: tablegen writes what it has read into DIR/tablegen-build.d, as the last thing that it does, and only if
# it succeeds. That file is a stamp, a rule for itself, and a makefile that this one includes. Make therefore brings it
# up to date first, once for all jobs, and then starts again, now knowing what the build consists of. Files whose
# content stays are not touched, so that nothing is compiled for a changed comment.

TABLEGEN ?= tablegen

# Nothing is built if make is asked for no other goals than these.
TABLEGEN_IDLE_GOALS ?= clean distclean

ifeq ($(shell command -v $(firstword $(TABLEGEN)) 2>/dev/null),)
$(error $(firstword $(TABLEGEN)) is not found: put tablegen on PATH ('pip install piezo-tablegen' does), or give TABLEGEN=PATH)
endif

# $(call tablegen_build,SCAN,DIR): to be evaluated; see above.
tablegen_build = $(call tablegen_rules,$(call tablegen_path,scan,$(1)),$(call tablegen_path,directory,$(2)))

# $(call tablegen_runtime,SCANS,DIR): to be evaluated; see above.
tablegen_runtime = $(call tablegen_runtime_rules,$(call tablegen_scans,$(1)),$(call tablegen_path,directory,$(2)))

# Directories of several scans have the names of their files.
tablegen_scans = $(if $(filter $(words $(1)),$(words $(sort $(basename $(notdir $(1)))))),$(strip $(1)),$(error \
    tablegen_runtime: the scans are '$(strip $(1))'; give some, whose files have different names))

tablegen_path = $(if $(filter 1,$(words $(2))),$(patsubst %/,%,$(strip $(2))),$(error \
    tablegen_build: the $(1) is '$(2)'; give one path without a space, which make cannot take (CMake can)))

tablegen_goals := $(if $(MAKECMDGOALS),$(filter-out $(TABLEGEN_IDLE_GOALS),$(MAKECMDGOALS)),all)

# What the manifest lists: a line "NAME.EXTENSION": "SHA-256" for each file.
tablegen_listed = $(shell \
    sed -n 's/^ *"\([A-Za-z0-9_-]*\.[A-Za-z0-9.]*\)": "[0-9a-f]\{64\}",*$$/\1/p' $(1)/manifest.json 2>/dev/null)

# $(call tablegen_option,NAME,HEADER): the option of a compiler, from the constant of a header.
tablegen_option = $(shell sed -n 's/^#define [A-Z0-9_]*_$(1) \([0-9]*\)$$/-DDAC_$(1)=\1/p' $(2) /dev/null 2>/dev/null)

tablegen_options := TABLE_STORAGE_BITS OUTPUT_STORAGE_BITS SHAPING SPLINE SLOW_PART PIXEL_TABLE

.PHONY: tablegen-incomplete

# Rules must not become the default goal of the Makefile, which may come later.
define tablegen_rules
tablegen_default := $$(.DEFAULT_GOAL)

$(2)/tablegen-build.d: $(1)
	$$(TABLEGEN) build $(1) --output $(2) --quiet --depfile $$@ --depfile-target $$@

ifneq ($$(tablegen_goals),)
include $(2)/tablegen-build.d
endif

$(2)_FILES := $(2)/manifest.json $$(addprefix $(2)/,$$(call tablegen_listed,$(2)))
$(2)_SOURCES := $$(filter %.c,$$($(2)_FILES))
$(2)_HEADERS := $$(filter %.h,$$($(2)_FILES))
$(2)_CPPFLAGS := $$(foreach option,$$(tablegen_options),$$(call tablegen_option,$$(option),$$(filter-out $(2)/dac_%,$$($(2)_HEADERS))))
$(2)_OPTIONS := $(2)/tablegen-build.options
$(2)_VERILOG := $$(filter %.v,$$($(2)_FILES))
$(2)_MEMORY := $$(filter %.mem,$$($(2)_FILES))

# Written as soon as the options are known, and only if they are others: its time is that of the last change.
ifneq ($$(and $$(tablegen_goals),$$(wildcard $(2)/manifest.json)),)
ifneq ($$(file <$$($(2)_OPTIONS)),$$($(2)_CPPFLAGS))
$$(file >$$($(2)_OPTIONS),$$($(2)_CPPFLAGS))
endif
endif
$$($(2)_OPTIONS): ;

# A file that somebody has removed is made again.
ifneq ($$(filter-out $$(wildcard $$($(2)_FILES)),$$($(2)_FILES)),)
$(2)/tablegen-build.d: tablegen-incomplete
endif

.DEFAULT_GOAL := $$(tablegen_default)
endef

# Several scans: each as above, but for the options, which are those of all of them. The stamp of their header is a
# makefile as well, so that the header is there before make looks at anything else.
define tablegen_runtime_rules
tablegen_folders := $$(addprefix $(2)/,$(basename $(notdir $(1))))
$(foreach scan,$(1),$(call tablegen_rules,$(scan),$(2)/$(basename $(notdir $(scan))))
)
tablegen_default := $$(.DEFAULT_GOAL)

$(2)/tablegen-runtime.d: $$(addsuffix /tablegen-build.d,$$(tablegen_folders))
	$$(TABLEGEN) runtime $(addprefix $(2)/,$(basename $(notdir $(1)))) --output $(2)/dac_options.h --quiet
	@echo '# A stamp: dac_options.h is that of these scans.' >$$@

ifneq ($$(tablegen_goals),)
include $(2)/tablegen-runtime.d
endif

ifneq ($$(wildcard $(2)/dac_options.h),$(2)/dac_options.h)
$(2)/tablegen-runtime.d: tablegen-incomplete
endif

$(foreach kind,FILES HEADERS VERILOG MEMORY,
$(2)_$(kind) := $$(foreach folder,$$(tablegen_folders),$$($$(folder)_$(kind))))
$(2)_SOURCES := $$($$(firstword $$(tablegen_folders))_SOURCES) \
    $$(foreach folder,$$(tablegen_folders),$$(filter-out $$(folder)/dac_%,$$($$(folder)_SOURCES)))
$(2)_SOURCES := $$(sort $$($(2)_SOURCES))
$(2)_CPPFLAGS := $$(addprefix -I,$(2) $$(tablegen_folders)) -DDAC_CONFIG_FILE='"dac_options.h"'
$(2)_OPTIONS := $(2)/dac_options.h
$$($(2)_OPTIONS): ;

.DEFAULT_GOAL := $$(tablegen_default)
endef
