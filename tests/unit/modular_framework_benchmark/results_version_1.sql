-- A result database of version 1, as its release wrote it: three of four episodes are finished.
BEGIN TRANSACTION;
CREATE TABLE descriptions (
	id INTEGER NOT NULL, 
	name VARCHAR(512) NOT NULL, 
	digest VARCHAR(64) NOT NULL, 
	content TEXT NOT NULL, 
	added REAL NOT NULL, 
	PRIMARY KEY (id), 
	UNIQUE (name)
);
INSERT INTO "descriptions" VALUES(1,'picks','d1','{"compared":"grasp_method","confidence":0.95,"digest":"d1","factors":[{"levels":["top_down","antipodal"],"name":"grasp_method"},{"levels":["cup","can"],"name":"object"},{"levels":["0.50"],"name":"speed"}],"metrics":[{"better":"higher","component":"task","description":"","highest":null,"kind":"rate","limit":null,"lowest":null,"name":"success","unit":""},{"better":"lower","component":"planning","description":"","highest":null,"kind":"time","limit":5.0,"lowest":null,"name":"planning_time","unit":"s"},{"better":"lower","component":"task","description":"","highest":null,"kind":"time","limit":null,"lowest":null,"name":"task_time","unit":"s"},{"better":"higher","component":"generation","description":"","highest":null,"kind":"count","limit":null,"lowest":null,"name":"candidates","unit":""},{"better":"lower","component":"grasp","description":"","highest":null,"kind":"rate","limit":null,"lowest":null,"name":"slipped","unit":""}],"mode":"task","name":"picks","sequential":false,"source":"","text":"# compares two grasp methods\nname: picks\n","time_limit_s":60.0}',1.79573687623594284053e+09);
CREATE TABLE enums (
	name VARCHAR(512) NOT NULL, 
	value INTEGER NOT NULL, 
	description TEXT, 
	PRIMARY KEY (name, value)
);
INSERT INTO "enums" VALUES('status',0,'succeeded');
INSERT INTO "enums" VALUES('status',1,'failed');
INSERT INTO "enums" VALUES('status',2,'timed_out');
INSERT INTO "enums" VALUES('status',3,'broken');
CREATE TABLE episodes (
	id INTEGER NOT NULL, 
	descriptionid INTEGER NOT NULL, 
	experimentid INTEGER NOT NULL, 
	plannerid INTEGER NOT NULL, 
	number INTEGER NOT NULL, 
	"key" TEXT NOT NULL, 
	trial BIGINT NOT NULL, 
	seed BIGINT NOT NULL, 
	configuration TEXT NOT NULL, 
	settings TEXT NOT NULL, 
	PRIMARY KEY (id), 
	UNIQUE (descriptionid, "key"), 
	UNIQUE (descriptionid, number), 
	FOREIGN KEY(descriptionid) REFERENCES descriptions (id), 
	FOREIGN KEY(experimentid) REFERENCES experiments (id), 
	FOREIGN KEY(plannerid) REFERENCES "plannerConfigs" (id)
);
INSERT INTO "episodes" VALUES(1,1,1,2,0,'grasp_method=top_down,object=cup,speed=0.50;trial=0',0,1000,'{"grasp_method":"top_down","object":"cup","speed":"0.50"}','{"grasp_method":"top_down","speed":0.5,"world":{"object":"cup","pose":[0.1,0.2,0.3]}}');
INSERT INTO "episodes" VALUES(2,1,2,2,1,'grasp_method=top_down,object=can,speed=0.50;trial=0',0,1000,'{"grasp_method":"top_down","object":"can","speed":"0.50"}','{"grasp_method":"top_down","speed":0.5,"world":{"object":"can","pose":[0.1,0.2,0.3]}}');
INSERT INTO "episodes" VALUES(3,1,1,1,2,'grasp_method=antipodal,object=cup,speed=0.50;trial=0',0,1000,'{"grasp_method":"antipodal","object":"cup","speed":"0.50"}','{"grasp_method":"antipodal","speed":0.5,"world":{"object":"cup","pose":[0.1,0.2,0.3]}}');
INSERT INTO "episodes" VALUES(4,1,2,1,3,'grasp_method=antipodal,object=can,speed=0.50;trial=0',0,1000,'{"grasp_method":"antipodal","object":"can","speed":"0.50"}','{"grasp_method":"antipodal","speed":0.5,"world":{"object":"can","pose":[0.1,0.2,0.3]}}');
CREATE TABLE experiments (
	id INTEGER NOT NULL, 
	name VARCHAR(512) NOT NULL, 
	totaltime REAL NOT NULL, 
	timelimit REAL, 
	memorylimit REAL, 
	runcount INTEGER NOT NULL, 
	version VARCHAR(128) NOT NULL, 
	hostname VARCHAR(1024) NOT NULL, 
	cpuinfo TEXT NOT NULL, 
	date DATETIME NOT NULL, 
	seed BIGINT, 
	setup TEXT NOT NULL, object VARCHAR(512), speed REAL, 
	PRIMARY KEY (id)
);
INSERT INTO "experiments" VALUES(1,'picks',25.0,60.0,NULL,1,'0.1.0-7-gabc','lab-1','2 x a processor','2026-11-26 23:47:56.000000',NULL,'# compares two grasp methods
name: picks
','cup',0.5);
INSERT INTO "experiments" VALUES(2,'picks',12.5,60.0,NULL,1,'0.1.0-7-gabc','lab-1','2 x a processor','2026-11-26 23:47:56.000000',NULL,'# compares two grasp methods
name: picks
','can',0.5);
CREATE TABLE "plannerConfigs" (
	id INTEGER NOT NULL, 
	name VARCHAR(512) NOT NULL, 
	settings TEXT NOT NULL, 
	PRIMARY KEY (id)
);
INSERT INTO "plannerConfigs" VALUES(1,'antipodal','{"grasp_method":"antipodal","speed":0.5}');
INSERT INTO "plannerConfigs" VALUES(2,'top_down','{"grasp_method":"top_down","speed":0.5}');
CREATE TABLE progress (
	runid INTEGER NOT NULL, 
	time REAL NOT NULL, 
	PRIMARY KEY (runid, time), 
	FOREIGN KEY(runid) REFERENCES runs (id)
);
CREATE TABLE records (
	runid INTEGER NOT NULL, 
	outcome TEXT NOT NULL, 
	cause TEXT NOT NULL, 
	begun REAL NOT NULL, 
	folder TEXT NOT NULL, 
	worker TEXT NOT NULL, 
	snapshot TEXT NOT NULL, 
	PRIMARY KEY (runid), 
	FOREIGN KEY(runid) REFERENCES runs (id)
);
INSERT INTO "records" VALUES(1,'succeeded','',1700000000.0,'picks/episode_0','worker-1','{"machine":2,"seeds":3,"version":1}');
INSERT INTO "records" VALUES(2,'succeeded','',1700000001.0,'picks/episode_1','worker-1','{"machine":2,"seeds":3,"version":1}');
INSERT INTO "records" VALUES(3,'failed','no motion found',1700000002.0,'picks/episode_2','worker-1','{"machine":2,"seeds":3,"version":1}');
CREATE TABLE runs (
	id INTEGER NOT NULL, 
	experimentid INTEGER NOT NULL, 
	plannerid INTEGER NOT NULL, 
	status INTEGER NOT NULL, 
	success BOOLEAN NOT NULL, 
	wall_s REAL NOT NULL, 
	simulated_s REAL, planning_time REAL, task_time REAL, candidates REAL, slipped BOOLEAN, 
	PRIMARY KEY (id), 
	FOREIGN KEY(id) REFERENCES episodes (id), 
	FOREIGN KEY(experimentid) REFERENCES experiments (id), 
	FOREIGN KEY(plannerid) REFERENCES "plannerConfigs" (id)
);
INSERT INTO "runs" VALUES(1,1,2,0,1,12.5,10.25,0.125,20.5,40.0,NULL);
INSERT INTO "runs" VALUES(2,2,2,0,1,12.5,10.25,0.25,21.5,40.0,NULL);
INSERT INTO "runs" VALUES(3,1,1,1,0,12.5,10.25,0.375,22.5,40.0,NULL);
CREATE TABLE schema_version (
	version INTEGER NOT NULL
);
INSERT INTO "schema_version" VALUES(1);
CREATE TABLE snapshot_values (
	id INTEGER NOT NULL, 
	name TEXT NOT NULL, 
	digest VARCHAR(64) NOT NULL, 
	value TEXT NOT NULL, 
	PRIMARY KEY (id), 
	UNIQUE (name, digest)
);
INSERT INTO "snapshot_values" VALUES(1,'version','ad7b73d08c4b8a427f5c3a6a956261554c77c44ff0c5ea245856d2bbed002ee0','"0.1.0-7-gabc"');
INSERT INTO "snapshot_values" VALUES(2,'machine','b25dd3a8b0fc93ed97065a1b0e86e7c72ef66048feccaa66a39c92b9d76b3db8','{"processors":2}');
INSERT INTO "snapshot_values" VALUES(3,'seeds','3c323eba419f5326465ab7e016d8c1564b03cc1ab2ab39586d43b578c27bb148','{"episode":1000}');
CREATE TABLE spans (
	runid INTEGER NOT NULL, 
	place INTEGER NOT NULL, 
	kind TEXT NOT NULL, 
	name TEXT NOT NULL, 
	started_s REAL NOT NULL, 
	ended_s REAL, 
	outcome TEXT NOT NULL, 
	failed BOOLEAN NOT NULL, 
	reason TEXT NOT NULL, 
	PRIMARY KEY (runid, place), 
	FOREIGN KEY(runid) REFERENCES runs (id)
)
 WITHOUT ROWID

;
INSERT INTO "spans" VALUES(1,0,'state','PICK/APPROACH',0.5,4.0,'ok',0,'');
INSERT INTO "spans" VALUES(1,1,'component','planning',0.75,NULL,'',0,'');
INSERT INTO "spans" VALUES(2,0,'state','PICK/APPROACH',0.5,4.0,'ok',0,'');
INSERT INTO "spans" VALUES(2,1,'component','planning',0.75,NULL,'',0,'');
INSERT INTO "spans" VALUES(3,0,'state','PICK/APPROACH',0.5,4.0,'ok',0,'');
INSERT INTO "spans" VALUES(3,1,'component','planning',0.75,NULL,'',1,'no motion found');
COMMIT;
