within TrainRig.Tests;
model RailIsCleanedBySlip "Slip work brings the rail nearer to clean by its share of what cleans wholly"
  Parts.Rail half(length=2.5, v=20.0, mu=0.08, work=2000.0, muStart=0.08);
  Parts.Rail whole(length=2.5, v=20.0, mu=0.20, work=9000.0, muStart=0.20);
  Parts.Rail dry(length=2.5, v=20.0, mu=0.40, work=9000.0, muStart=0.40);
protected
  Real come(unit="1") = 1.0 - exp(-8.0*time) "What has come of the first axle's rail, 20 m/s over 2.5 m";
equation
  assert(abs(half.next - (0.08 + 0.5*0.08*come)) < 1e-7, "Half of the work is not half of the way");
  assert(abs(whole.next - (0.20 + 0.12*come)) < 1e-7, "Wet rail does not become clean");
  assert(abs(dry.next - 0.40) < 1e-9, "Dry rail changes");
  annotation (experiment(StopTime=1.0, Tolerance=1e-9));
end RailIsCleanedBySlip;
