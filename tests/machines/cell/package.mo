package Cell "A cell whose current is drawn"
  model Observer "Its charge and the polarisation of its electrodes"
    parameter Real R(unit="Ohm") = 0.02 "Resistance";
    input Real I(unit="A") "Current";
    input Real dR(unit="Ohm") "Correction of R";
    output Real v(unit="V") = 3.0 + charge - (R + dR)*I - polarisation "Voltage";
    Real charge(unit="1", start=0.9, fixed=true) "State of charge";
    Real polarisation(unit="V", start=0.0, fixed=true, nominal=0.05) "Of the electrodes";
  equation
    9000.0*der(charge) = -I;
    20.0*der(polarisation) = 0.01*I - polarisation;
  end Observer;
end Cell;
