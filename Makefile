# SPDX-License-Identifier: BSD-3-Clause
.PHONY: help build lint unit rostest system test full bench site wheel requirements
help:            ## list what can be made
	@grep -E '^[a-z]+: *##' $(MAKEFILE_LIST) | sed 's/: *##/\t/' | expand -t 16
build:           ## set up and build
	./install.sh
lint:            ## check style, types, manifests and scripts
	./install.sh test lint
unit:            ## run the tests that need no ROS master
	./install.sh test unit
rostest:         ## run the tests of nodes
	./install.sh test rostest
system:          ## run the tests of whole launches
	./install.sh test system
test:            ## run the tests that continuous integration runs
	./install.sh test
full:            ## run all tests
	./install.sh test full
bench:           ## run every benchmark, quickly
	@for benchmark in benchmarks/*; do [ -x $$benchmark ] && ./install.sh exec $$benchmark --quick || exit 1; done
site:            ## build the documentation as a web site
	./install.sh site
wheel:           ## build the wheel of statistics and reports, which needs no ROS
	./install.sh wheel
requirements:    ## compile requirements.txt and requirements-site.txt
	.venv/bin/pip install --quiet pip-tools
	.venv/bin/pip-compile --quiet --no-emit-index-url --no-emit-find-links --no-emit-trusted-host --strip-extras --no-header -o requirements.txt requirements.in
	.venv/bin/pip-compile --quiet --no-emit-index-url --no-emit-find-links --no-emit-trusted-host --strip-extras --no-header -o requirements-site.txt requirements-site.in
