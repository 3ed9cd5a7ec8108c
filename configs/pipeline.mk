# A laboratory's pipeline: recordings/*.h5 -> build/ -> report. Copy it beside a folder `recordings/` and run
#     make -f pipeline.mk -j4            (or: make -f /path/to/configs/pipeline.mk RECORDINGS=elsewhere BUILD=results)
# Only what changed is made again; a step that fails leaves no output, so that make tries it again.
# Recordings named free-*.h5 are free run-downs (resonator, diagnosis), the others are forced runs (calibration).

HRG ?= hrg
RECORDINGS ?= recordings
BUILD ?= build
CONFIG ?= $(wildcard $(RECORDINGS)/chain.toml)
SETTINGS := $(if $(CONFIG),--config $(CONFIG))
# Exit status 3 (a refused result, its file is written with its reasons) must not stop the report that shows them.
KEEP = ; status=$$?; [ $$status -eq 0 ] || [ $$status -eq 3 ]

RUNS := $(patsubst $(RECORDINGS)/%.h5,%,$(wildcard $(RECORDINGS)/*.h5))
FREE := $(filter free-%,$(RUNS))
FORCED := $(filter-out free-%,$(RUNS))
WAVES := $(RUNS:%=$(BUILD)/%.wave.h5)
RESULTS := $(if $(FREE),$(BUILD)/resonator.h5 $(BUILD)/diagnosis.h5) \
           $(if $(FORCED),$(BUILD)/calibration.h5 $(BUILD)/calibration.csv $(FORCED:%=$(BUILD)/%.compensated.h5))

.PHONY: all clean
.SECONDARY:
.DELETE_ON_ERROR:

all: $(BUILD)/report.html

$(BUILD):
	mkdir -p $@

$(BUILD)/%.periods.h5: $(RECORDINGS)/%.h5 $(CONFIG) | $(BUILD)
	$(HRG) demodulate $< -o $@ --force -q $(SETTINGS) $(KEEP)

$(BUILD)/%.wave.h5: $(BUILD)/%.periods.h5 $(CONFIG)
	$(HRG) estimate $< -o $@ --force -q $(SETTINGS) $(KEEP)

$(BUILD)/resonator.h5: $(FREE:%=$(BUILD)/%.wave.h5) $(CONFIG)
	$(HRG) identify $(filter %.wave.h5,$^) -o $@ --force -q $(SETTINGS) $(KEEP)

$(BUILD)/diagnosis.h5: $(FREE:%=$(BUILD)/%.wave.h5) $(CONFIG)
	$(HRG) diagnose $(filter %.wave.h5,$^) -o $@ --force -q $(SETTINGS) $(KEEP)

# Refused tables are applied to nothing and exported nowhere: the mark beside them says so, and the report shows their reasons.
REFUSED := $(BUILD)/calibration.refused
UNLESS_REFUSED = [ -e $(REFUSED) ] ||

$(BUILD)/calibration.h5: $(FORCED:%=$(BUILD)/%.wave.h5) $(CONFIG)
	rm -f $(REFUSED)
	$(HRG) calibrate $(filter %.wave.h5,$^) -o $@ --force -q $(SETTINGS); status=$$?; \
	if [ $$status -eq 3 ]; then touch $(REFUSED); else exit $$status; fi

$(BUILD)/calibration.csv: $(BUILD)/calibration.h5
	$(UNLESS_REFUSED) $(HRG) export $< -o $@ --force -q

$(BUILD)/%.compensated.h5: $(BUILD)/%.wave.h5 $(BUILD)/calibration.h5 $(CONFIG)
	$(UNLESS_REFUSED) { $(HRG) compensate $< --calibration $(BUILD)/calibration.h5 -o $@ --force -q $(SETTINGS) $(KEEP); }

$(BUILD)/report.html: $(RUNS:%=$(RECORDINGS)/%.h5) $(WAVES) $(RESULTS)
	$(HRG) report $$(ls $(filter %.h5,$^) 2>/dev/null) -o $@ --force -q $(KEEP)

clean:
	rm -rf $(BUILD)
