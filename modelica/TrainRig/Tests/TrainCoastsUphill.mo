within TrainRig.Tests;
model TrainCoastsUphill "Without brakes and resistance a gradient acts on all that moves, turning or not"
  TwoVehicles train(
    A=0.0, B=0.0, C=0.0, pB1=0.0, pB2=0.0, pB3=0.0, pB4=0.0, mass1=44e3, mass2=56e3, slope1=0.01,
    slope2=0.0, curve=1e-3, dmuDC1=0.0, dmuDC2=0.0, dmuDC3=0.0, dmuDC4=0.0, dmuDC5=0.0, dmuDC6=0.0,
    dmuDC7=0.0, dmuDC8=0.0,
    dr1=0.0, dr2=0.0, dr3=0.0, dr4=0.0, dr5=0.0, dr6=0.0, dr7=0.0, dr8=0.0, dbias=0.0,
    dmuWR=0.0, dmass1=0.0, dmass2=0.0, dA=0.0, dC=0.0, dgradient=0.0, vTrain(start=4.6), omega1(start=10.0), omega2(start=10.0),
    omega3(start=10.0), omega4(start=10.0), omega5(start=10.0), omega6(start=10.0),
    omega7(start=10.0), omega8(start=10.0));
protected
  // Bearings: 31.4 N.m at 10 rad/s, of which 0.7 N.m per rad/s.
  Real bearings(unit="N") = 8.0*(25.0 + 0.6*train.omega1 + 0.004*train.omega1^2)/0.46;
equation
  assert(time < 1.0 or abs(train.acceleration*(100e3 + 8.0*110.0/0.46^2)
    + 9.81*(44e3*0.01 + 100e3*1e-3) + bearings) < 2.0, "Gradient, curve and bearings do not act");
  assert(abs(train.felt - train.acceleration - 0.0981) < 1e-9,
    "The accelerometer does not feel the gradient of the first vehicle");
  annotation (experiment(StopTime=10.0, Tolerance=1e-8));
end TrainCoastsUphill;
