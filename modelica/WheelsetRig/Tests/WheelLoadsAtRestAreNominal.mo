within WheelsetRig.Tests;
model WheelLoadsAtRestAreNominal "At rest each wheel carries 80 kN and nothing moves"
  Reference rig(pB=0.0, tauR=0.0, dmuWR=0.0, dmuDC=0.0);
equation
  // 1e-6 of the wheel load and of a deflection of 1 mm: rounding is 1e-9 of both.
  assert(abs(rig.FzL - 80000.0) < 0.08, "Load of the left wheel");
  assert(abs(rig.FzR - 80000.0) < 0.08, "Load of the right wheel");
  assert(abs(rig.FcellL) < 0.08 and abs(rig.FcellR) < 0.08, "The longitudinal cylinders carry load");
  assert(rig.frameMotion.r*rig.frameMotion.r < 1e-18, "The frame moves");
  assert(rig.wheelset.r*rig.wheelset.r < 1e-18, "The wheelset moves");
  annotation (experiment(StopTime=1.0, Tolerance=1e-8));
end WheelLoadsAtRestAreNominal;
