within WheelsetRig.Interfaces;
partial model PartialForce "Massless force element: action and reaction, energy and loss"
  extends PartialTwoFrames;
  Units.Energy energy "Energy stored, counted from rest";
  Units.Power lossPower "Power turned into heat, never negative";
equation
  frame_a.f + frame_b.f = zeros(3);
  frame_a.t + frame_b.t = zeros(3);
end PartialForce;
