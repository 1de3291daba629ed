# What all ports have in common: SCAN is built into BUILD/scan, and OWN is compiled with it and the link for CPU.
#
#     make SCAN=scan.toml BAUD=460800 CFLAGS=-O3
#
# CONVERTER is a file of converters/, for ports that send its frames: SPI_CONVERTER in C.
#
# A port sets OWN, CPU, LINK (where everything goes) and BOARD_FLAGS before it includes this, and PRIVATELY, which stands
# in front of commands whose output others must not read. One for another processor than a Cortex-M sets CROSS and
# ARCHITECTURE in place of CPU; WITHOUT names files of the runtime that files of its own replace. One with TAKES_Z has a
# second sequencer for the output z, and compiles with DAC_LINK_Z=1 where the scan has z.
CROSS ?= arm-none-eabi-gcc
CFLAGS ?= -O2
BAUD ?= 115200
CONTROL ?= link
ARCHITECTURE ?= -mcpu=$(CPU) -mthumb
COMMIT_MODES ?= 1
OWN_link := control_link scan_link

TABLEGEN ?= tablegen
include $(or $(shell $(TABLEGEN) paths --make),$(error $(TABLEGEN) does not run: install piezo-tablegen, or give TABLEGEN=PATH))
$(eval $(call tablegen_build,$(SCAN),$(BUILD)/scan))

# A scan with the output z has a second name, NAME_z.
SCAN_NAMES := $(basename $(notdir $(filter-out $(BUILD)/scan/dac_% %_program.h,$($(BUILD)/scan_HEADERS))))
SCAN_NAME := $(filter-out $(SCAN_NAMES:%=%_z),$(SCAN_NAMES))
SCAN_Z := $(filter $(SCAN_NAME)_z,$(SCAN_NAMES))
ifneq ($(and $(SCAN_Z),$(if $(TAKES_Z),,no)),)
$(error $(SCAN) has the output z, which this port does not have)
endif
SCAN_UPPER := $(shell echo $(SCAN_NAME) | tr a-z A-Z)

vpath memory.c ..
vpath %.c ../common
OBJECTS := $(patsubst %,$(BUILD)/%.o,$(OWN) $(OWN_$(CONTROL)) scan memory) $(patsubst %.c,%.o,$(filter-out $(WITHOUT:%=$(BUILD)/scan/%),$($(BUILD)/scan_SOURCES)))
COMPILE := $(CROSS) -std=c99 $(ARCHITECTURE) -ffreestanding -ffunction-sections -fdata-sections \
    -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Werror -I$(BUILD)/scan -I. -I../common -MMD -MP \
    -DSCAN=$(SCAN_NAME) -DSCAN_UPPER=$(SCAN_UPPER) -DSCAN_HEADER='"$(SCAN_NAME).h"' \
    $(if $(CONVERTER),-I../converters -DSPI_CONVERTER=$(CONVERTER) -DCONVERTER_HEADER='"$(CONVERTER).h"') \
    $(if $(SCAN_Z),-DDAC_LINK_Z=1 -DSCAN_Z_HEADER='"$(SCAN_Z).h"') \
    $($(BUILD)/scan_CPPFLAGS) -DDAC_COMMIT_MODES=$(COMMIT_MODES) -DUPDATE_RATE_HZ=$(UPDATE_RATE_HZ) -DBAUD=$(BAUD) $(BOARD_FLAGS) $(CFLAGS)

$(BUILD)/firmware.elf: $(OBJECTS) $(LINK_FILES)
	$(PRIVATELY) $(CROSS) $(ARCHITECTURE) -nostdlib -static -Wl,--gc-sections $(LINK) $(OBJECTS) -lgcc -o $@

$(BUILD)/%.o: %.c
	$(PRIVATELY) $(COMPILE) -c $< -o $@

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
