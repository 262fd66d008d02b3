within SealFriction;
package Effects "Catalogue: what the nominal cylinder leaves out"
  annotation (Documentation(info="<html>
<p>What matters is taken from the sensors: a load cell for 500 N is off by 0.2 N between two
calibrations, and all effects are held against that at 10 mm/s and 7 bar.</p>
</html>"));
end Effects;
