# What all ports have in common: SCAN is built into BUILD/scan, and OWN is compiled with it and the link for CPU.
#
#     make SCAN=scan.toml BAUD=460800 CFLAGS=-O3
#     make KEY_FILE=key.hex DEVICE=afm-7    a key for the link, where a port has random numbers (random.c): a file with 16
#                                           to 32 bytes in hexadecimal, and a name that no other instrument with this key
#                                           has. What contains the key is readable by you alone
#
# A port sets OWN, CPU, LINK (where everything goes) and BOARD_FLAGS before it includes this.
CROSS ?= arm-none-eabi-gcc
CFLAGS ?= -O2
BAUD ?= 115200
KEY_FILE ?=
DEVICE ?= $(notdir $(BUILD))
CONTROL ?= link
OWN_link := control_link scan_link

TABLEGEN ?= tablegen
include $(or $(shell $(TABLEGEN) paths --make),$(error $(TABLEGEN) does not run: install piezo-tablegen, or give TABLEGEN=PATH))
$(eval $(call tablegen_build,$(SCAN),$(BUILD)/scan))

SCAN_NAME := $(basename $(notdir $(filter-out $(BUILD)/scan/dac_%,$($(BUILD)/scan_HEADERS))))
SCAN_UPPER := $(shell echo $(SCAN_NAME) | tr a-z A-Z)

vpath memory.c ..
vpath %.c ../common
OBJECTS := $(patsubst %,$(BUILD)/%.o,$(OWN) $(OWN_$(CONTROL)) scan memory) $(patsubst %.c,%.o,$($(BUILD)/scan_SOURCES))
COMPILE := $(CROSS) -std=c99 -mcpu=$(CPU) -mthumb -ffreestanding -ffunction-sections -fdata-sections \
    -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Werror -I$(BUILD)/scan -I. -I../common -MMD -MP \
    -DSCAN=$(SCAN_NAME) -DSCAN_UPPER=$(SCAN_UPPER) -DSCAN_HEADER='"$(SCAN_NAME).h"' \
    $($(BUILD)/scan_CPPFLAGS) \
    -DUPDATE_RATE_HZ=$(UPDATE_RATE_HZ) -DBAUD=$(BAUD) \
    $(if $(KEY_FILE),-I$(BUILD) -DLINK_KEY_HEADER='"link_key.h"' -DLINK_DEVICE='"$(DEVICE)"') \
    $(BOARD_FLAGS) $(CFLAGS)

ifneq ($(KEY_FILE),)
$(if $(wildcard random.c),,$(error this port has no source of random numbers, which a key needs: write random.c, see cortex_m))
endif

# In front of a command: with a key, nobody else can read what it writes.
PRIVATELY = $(if $(KEY_FILE),umask 077 && rm -f $@ &&)

$(BUILD)/firmware.elf: $(OBJECTS) $(LINK_FILES)
	$(PRIVATELY) $(CROSS) -mcpu=$(CPU) -mthumb -nostdlib -static -Wl,--gc-sections $(LINK) $(OBJECTS) -lgcc -o $@

$(BUILD)/%.o: %.c
	$(PRIVATELY) $(COMPILE) -c $< -o $@

# The key as C, from one file to another, and on no command line.
ifneq ($(KEY_FILE),)
.PHONY: $(BUILD)/link_key.new
$(BUILD)/link_key.new: $(KEY_FILE)
	@mkdir -p $(@D)
	@test -z "$$(find -L '$<' -perm /077)" || echo "warning: $<: others can read the key: chmod 600 '$<'" >&2
	@tr -d ' \t\r\n' <'$<' | grep -Eqx '([0-9A-Fa-f]{2}){16,32}' || \
	    { echo "$<: the key has to be 16 to 32 bytes in hexadecimal and nothing else" >&2; exit 1; }
	@umask 077 && rm -f $@ && \
	    { printf '#define LINK_KEY '; tr -d ' \t\r\n' <'$<' | sed 's/../0x&,/g'; echo; } >$@

$(BUILD)/link_key.h: $(BUILD)/link_key.new
	@if cmp -s $< $@; then rm $<; else mv $< $@; fi
$(BUILD)/scan_link.o: $(BUILD)/link_key.h
endif

$(BUILD)/scan/%.o: $(BUILD)/scan/%.c
	$(COMPILE) -c $< -o $@

# Objects are made again when they would be made otherwise.
$(OBJECTS): $(BUILD)/command
ifneq ($(file <$(BUILD)/command),$(COMPILE) $(OWN) $(CONTROL))
.PHONY: $(BUILD)/command
endif
$(BUILD)/command:
	@mkdir -p $(@D)
	$(file >$@,$(COMPILE) $(OWN) $(CONTROL))@:

-include $(OBJECTS:.o=.d)

.PHONY: clean
clean:
	rm -rf $(BUILD)
