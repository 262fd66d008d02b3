within TrainRig.Tests;
model SizeZeroIsNominal "With every effect at size zero the train moves as the nominal one"
  constant Real tolerance(unit="1") = 1e-8 "Of the solver, as in the experiment";
  Real p(unit="Pa") = 2.0e5*(1.0 - exp(-time)) "In all cylinders";
  TwoVehicles nominal(
    pB1=p, pB2=p, pB3=p, pB4=p, mass1=47e3, mass2=53e3, slope1=1e-3, slope2=0.0, curve=0.0,
    dmuDC1=0.0, dmuDC2=0.0, dmuDC3=0.0, dmuDC4=0.0, dmuDC5=0.0, dmuDC6=0.0, dmuDC7=0.0, dmuDC8=0.0,
    dr1=0.0, dr2=0.0, dr3=0.0, dr4=0.0, dr5=0.0, dr6=0.0, dr7=0.0, dr8=0.0, dbias=0.0,
    dmuWR=0.0, dmass1=0.0, dmass2=0.0, dA=0.0, dC=0.0, dgradient=0.0,
    vTrain(start=30.0), omega1(start=65.0), omega2(start=65.0), omega3(start=65.0),
    omega4(start=65.0), omega5(start=65.0), omega6(start=65.0), omega7(start=65.0),
    omega8(start=65.0));
  TwoVehicles zero(
    pB1=p, pB2=p, pB3=p, pB4=p, mass1=47e3, mass2=53e3, slope1=1e-3, slope2=0.0, curve=0.0,
    dmuDC1=0.0, dmuDC2=0.0, dmuDC3=0.0, dmuDC4=0.0, dmuDC5=0.0, dmuDC6=0.0, dmuDC7=0.0, dmuDC8=0.0,
    dr1=0.0, dr2=0.0, dr3=0.0, dr4=0.0, dr5=0.0, dr6=0.0, dr7=0.0, dr8=0.0, dbias=0.0,
    dmuWR=0.0, dmass1=0.0, dmass2=0.0, dA=0.0, dC=0.0, dgradient=0.0,
    vTrain(start=30.0), omega1(start=65.0), omega2(start=65.0), omega3(start=65.0),
    omega4(start=65.0), omega5(start=65.0), omega6(start=65.0), omega7(start=65.0),
    omega8(start=65.0),
    redeclare Effects.CylinderLag cylinder, redeclare Effects.Glazing padFriction,
    redeclare Effects.IsolatedUnit brakeUnits, redeclare Effects.DraggingBrake dragging,
    redeclare Effects.WheelRadius radius, redeclare Effects.WrongMass weighed,
    redeclare Effects.LowAdhesion adhesion, redeclare Effects.WrongGradient gradient,
    redeclare Effects.AirResistance airResistance, redeclare Effects.LateSpeed speedSensor,
    redeclare Effects.AccelerometerBias accelerometer);
equation
  // A solver may leave its tolerance of 30 m/s and of 65 rad/s, tenfold for what adds up.
  assert(abs(zero.vTrain - nominal.vTrain) < 10.0*tolerance*30.0, "The train moves otherwise");
  assert(abs(zero.omegaReading[5] - nominal.omegaReading[5]) < 10.0*tolerance*65.0,
    "The reading is another one");
  // Of the 2 m/s2 that are felt.
  assert(abs(zero.a - nominal.a) < 10.0*tolerance*2.0, "Another acceleration is read");
  annotation (experiment(StopTime=5.0, Tolerance=1e-8));
end SizeZeroIsNominal;
