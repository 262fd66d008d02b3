package Lib
  model RollingWheelset "Wheelset without inertia or slip; linear at constant pressure"
    parameter Real rW(unit="m") = 0.46;
    parameter Real rR(unit="m") = 0.70;
    parameter Real JR(unit="kg.m2") = 1500.0;
    parameter Real muWR(unit="1") = 0.15;
    parameter Real muDC(unit="1") = 0.275;
    parameter Real pads(unit="m3") = 0.09 "Brake torque per pressure and friction";
    input Real pB(unit="Pa");
    input Real tauR(unit="N.m");
    input Real dmuWR(unit="1");
    input Real dmuDC(unit="1");
    output Real omegaW(unit="rad/s", start=0.0, fixed=true);
    output Real omegaR(unit="rad/s", start=0.0, fixed=true);
    output Real Fx(unit="N") = (muDC + dmuDC)*pads*pB/rW;
    output Real slip(unit="m/s") = rR*omegaR - rW*omegaW;
  equation
    JR*der(omegaR) = tauR - rR*Fx;
    rW*der(omegaW) = rR*der(omegaR);
  end RollingWheelset;
end Lib;
