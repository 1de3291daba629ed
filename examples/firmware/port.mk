# What the ports have in common: SCAN is built into BUILD/scan, and OWN is compiled with it for CPU.
CROSS ?= arm-none-eabi-gcc
CFLAGS ?= -O2

TABLEGEN ?= tablegen
include $(or $(shell $(TABLEGEN) paths --make),$(error $(TABLEGEN) does not run: install piezo-tablegen, or give TABLEGEN=PATH))
$(eval $(call tablegen_build,$(SCAN),$(BUILD)/scan))

SCAN_NAME := $(basename $(notdir $(filter-out $(BUILD)/scan/dac_%,$($(BUILD)/scan_HEADERS))))
SCAN_UPPER := $(shell echo $(SCAN_NAME) | tr a-z A-Z)
vpath memory.c ..
OBJECTS := $(patsubst %,$(BUILD)/%.o,$(OWN) memory) $(patsubst %.c,%.o,$($(BUILD)/scan_SOURCES))
COMPILE := $(CROSS) -std=c99 -mcpu=$(CPU) -mthumb -ffreestanding -ffunction-sections -fdata-sections \
    -Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Werror -I$(BUILD)/scan -I. -MMD -MP \
    -DSCAN=$(SCAN_NAME) -DSCAN_UPPER=$(SCAN_UPPER) -DSCAN_HEADER='"$(SCAN_NAME).h"' \
    -DUPDATE_RATE_HZ=$(UPDATE_RATE_HZ) $(CFLAGS)

$(BUILD)/firmware.elf: $(OBJECTS)
	$(CROSS) -mcpu=$(CPU) -mthumb -nostdlib -static -Wl,--gc-sections $(LINK) $(OBJECTS) -lgcc -o $@

$(BUILD)/%.o: %.c
	$(COMPILE) -c $< -o $@

$(BUILD)/scan/%.o: $(BUILD)/scan/%.c
	$(COMPILE) -c $< -o $@

-include $(OBJECTS:.o=.d)

.PHONY: clean
clean:
	rm -rf $(BUILD)
